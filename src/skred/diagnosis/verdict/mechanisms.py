"""Mechanisms in the verdict: what each is, where it acts and how strong it is.

Of an added mechanism there is one place and one interval of its strength, both over all places it may act at;
headline, table of candidates and draws all hold these.
"""

from __future__ import annotations

from typing import Any

from skred.diagnosis.augment.coefficient import augmented_of, strength_of
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.location import Location
from skred.diagnosis.evidence.covariates import standard_of
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.verdict.between import between_document, ways_document
from skred.inference.intervals import ENDS
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.mechanisms.stretches import equation_of


def place_of(candidate: Candidate) -> dict[str, Any] | None:
    """Medians of both ends of a mechanism's stretch, and their 90 % intervals; None where it is not local."""
    middle = candidate.ends(0.5)
    low, high = (candidate.ends(share) for share in ENDS)
    if middle is None or low is None or high is None:
        return None
    return {
        "s_from_m": middle[0],
        "s_to_m": middle[1],
        "s_from_interval_m": [low[0], high[0]],
        "s_to_interval_m": [low[1], high[1]],
    }


def strength_document(found: Diagnosis, number: int) -> dict[str, Any]:
    """The strength of an added mechanism, as the last calibration has it, over all places."""
    calibration = found.steps[-1].calibration
    added = augmented_of(calibration).added[number]
    return {
        "parameter": added.name,
        "unit": added.mechanism.strength.unit,
        **strength_of(found.steps, number)._asdict(),
        **between_document(calibration, added, found.steps[number].candidate),
    }


def added_document(found: Diagnosis, number: int) -> dict[str, Any]:
    """One mechanism that was added."""
    step = found.steps[number]
    mechanism, shape = step.candidate.mechanism, step.candidate.best.shape
    return {
        "id": mechanism.id,
        **kind_of(mechanism),
        "strength": strength_document(found, number),
        "location": place_of(step.candidate),
        "equation": equation_of(mechanism, shape),
        "covariate": shape.covariate,
        "standard": standard_of_covariate(found, shape.covariate),
        "sensor": shape.sensor,
        "constants": dict(shape.constants),
        "tied_with": list(step.tied),
        "log_bayes_factor": step.comparison.log_factors[mechanism.id],
    }


def kind_of(mechanism: Mechanism) -> dict[str, str]:
    """What a mechanism says is wrong and what it is bound to: a reader need not know its id."""
    return {"group": str(mechanism.group), "bound_to": str(added_of(mechanism).bound_to)}


def work_documents(location: Location) -> list[dict[str, Any]]:
    """Specific work that is missing between neighbouring sensors."""
    return [
        {"s_from_m": first, "s_to_m": last, "mean": mean, "sd": sd, "unit": "J kg-1"}
        for first, last, mean, sd in location.work.tolist()
    ]


def standard_of_covariate(found: Diagnosis, covariate: str | None) -> dict[str, Any] | None:
    """By what a covariate is standardised before its strength multiplies it."""
    standard = None if covariate is None else standard_of(found.problem.campaign.events, covariate)
    return None if standard is None else standard.as_dict()


def candidates_of(comparison: Comparison) -> dict[str, Candidate]:
    """Every mechanism of a comparison by id, under the error model that it has most of its evidence under."""
    names = dict.fromkeys(name for one in comparison.under_each for name in one.candidates)
    return {name: comparison.leading(name).candidates[name] for name in names}


def candidate_documents(found: Diagnosis, comparison: Comparison) -> list[dict[str, Any]]:
    """Every mechanism of a comparison; what was added from it with its strength as it was calibrated."""
    added = {
        step.candidate.mechanism.id: number
        for number, step in enumerate(found.steps)
        if step.comparison is comparison
    }
    log_factors, by_itself = comparison.log_factors, comparison.by_itself
    rows = [
        _candidate(one, log_factors[name], by_itself[name]) for name, one in candidates_of(comparison).items()
    ]
    for row in rows:
        if row["id"] in added:
            row["strength"] = strength_document(found, added[row["id"]])
    return rows


def _candidate(candidate: Candidate, log_factor: float, by_itself: float) -> dict[str, Any]:
    """One mechanism in a comparison, where and how strong it is if it is there."""
    strength, shape = candidate.mechanism.strength, candidate.best.shape
    of_places = candidate.strength_with_places
    return {
        "id": candidate.mechanism.id,
        **kind_of(candidate.mechanism),
        "log_bayes_factor": log_factor,
        "strength": {
            "parameter": strength.name,
            "unit": strength.unit,
            **candidate.strength()._asdict(),
            "ways": ways_document(candidate),
        },
        "location": place_of(candidate),
        "covariate": shape.covariate,
        "sensor": shape.sensor,
        "log_bayes_factor_se": candidate.error,
        "residue": candidate.residue,
        "log_bayes_factor_by_itself": by_itself,
        "strength_with_places": None if of_places is None else of_places._asdict(),
    }
