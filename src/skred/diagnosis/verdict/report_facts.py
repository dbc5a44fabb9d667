"""What the report says beside the verdict, as plain data: the key ``report`` of `verdict.json`.

With it and the curves of `skred.diagnosis.verdict.figure_data` the report is made from files alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from skred.campaign import Campaign, Status
from skred.diagnosis.augment.coefficient import augmented_of
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.check.decision import TIED_NATS
from skred.diagnosis.compare.comparison import ERROR_SHARES, Comparison
from skred.diagnosis.compare.location import Location
from skred.diagnosis.discrepancy.profile import KINDS, LENGTHS_M, NEAR_M
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.diagnosis.limits import LIMIT, NOTHING_AT_MOST
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.held_out import K_LIMIT, HeldOut, largest_k
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.verdict.mechanisms import candidate_documents, standard_of_covariate, work_documents
from skred.documents import FORMAT
from skred.inference.calibrate import Calibration
from skred.inference.error_model import ERROR_MODELS
from skred.inference.gate import ESS_LIMIT, R_HAT_LIMIT
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.influence_words import ERRS_BY
from skred.inference.intervals import PRACTICAL_DIFFERENCE, interval
from skred.physics.law import Law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.spec import Mechanism, Shape
from skred.physics.mechanisms.strength_prior import KIND, SCALES
from skred.physics.mechanisms.stretches import is_opposed


def report_facts(found: Outcome) -> dict[str, Any]:
    """What the page of a diagnosis quotes beside the verdict, as plain data.

    Of what was not diagnosed only the campaign, the law, and what was calibrated.
    """
    facts: dict[str, Any] = {
        "format": FORMAT,
        "campaign": _campaign(found.problem.campaign),
        "law": _law(found.law),
        "limits": _limits(),
        "calibrations": _calibrations(found),
        "parameters": _parameters(found),
    }
    return facts if isinstance(found, NotDiagnosed) else facts | _of_diagnosis(found)


def _of_diagnosis(found: Diagnosis) -> dict[str, Any]:
    return {
        "disputed": found.decision.disputed,
        "not_added": list(found.not_added),
        "mechanisms": _mechanisms(found),
        "checks": _checks(found),
        "force": _force(found.location),
        "profile_prior": _profile_prior(),
        "comparisons": [
            _comparison(comparison, found, number) for number, comparison in enumerate(comparisons_of(found))
        ],
        "added": [_added(found, number) for number in range(len(found.steps))],
        "log_score": _log_score(found),
    }


def comparisons_of(found: Diagnosis) -> list[Comparison]:
    """The model comparisons from which something was added, or the only one."""
    return [found.comparison, *(step.comparison for step in found.steps[1:])]


def _campaign(campaign: Campaign) -> dict[str, Any]:
    releases = [event.release_s_m for event in campaign.events]
    known = [event.release_sd_m for event in campaign.events if event.release_sd_m]
    speeds = [event.release_speed_m_s for event in campaign.events if event.release_speed_m_s]
    track = campaign.track
    return {
        "name": campaign.name,
        "description": campaign.description,
        "source": campaign.source,
        "origin": campaign.origin,
        "fingerprint": campaign.fingerprint(),
        "reference_s_m": campaign.reference_s_m,
        "n_events": campaign.n_events,
        "readings": {status.name.lower(): int(np.sum(campaign.status == status)) for status in Status},
        "release_s_m": [min(releases), max(releases)],
        "release_sd_m": float(np.median(known)) if known else None,
        "n_release_sd": len(known),
        "release_speed_m_s": [min(speeds), max(speeds)] if speeds else [],
        "n_release_speed": len(speeds),
        "track_length_m": track.length_m,
        "track_drop_m": float(np.ptp(track.z_m)),
        "covariates": sorted({name for event in campaign.events for name in event.covariates}),
    }


def _law(law: Law) -> dict[str, Any]:
    return {
        "id": law.id,
        "title": law.title,
        "equation": law.equation,
        "relation": law.relation,
        "mechanisms": [
            _mechanism(mechanism)
            | {
                "prior": {
                    "kind": "median across avalanches, half-normal",
                    "scale": mechanism.strength.prior_scale,
                    "reason": mechanism.strength.prior_reason,
                }
            }
            for mechanism in law.mechanisms
        ],
    }


def _mechanism(mechanism: Mechanism) -> dict[str, Any]:
    strength = mechanism.strength
    return {
        "id": mechanism.id,
        "title": mechanism.title,
        "kind": str(mechanism.group),
        "parameter": strength.name,
        "symbol": strength.symbol,
        "unit": strength.unit,
        "reference": mechanism.reference,
        "doi": mechanism.doi,
    }


def _mechanisms(found: Diagnosis) -> dict[str, Any]:
    """All that the comparisons and the table of detection limits name, by id."""
    listed = {row.mechanism.id: row.mechanism for row in found.table.rows}
    for comparison in comparisons_of(found):
        for under_errors in comparison.under_each:
            listed |= {name: candidate.mechanism for name, candidate in under_errors.candidates.items()}
    facts: dict[str, Any] = {
        NOTHING: {"title": "nothing missing", "kind": "nothing"},
        UNLISTED: {"title": "a force that is not in the list", "kind": "unlisted"},
    }
    for name, mechanism in listed.items():
        added = added_of(mechanism)
        prior = {
            "kind": KIND[added.either_sign],
            "scale": added.scale,
            "reason": added.reason,
        }
        facts[name] = _mechanism(mechanism) | {"prior": prior}
    return facts


def _limits() -> dict[str, float]:
    """What the page measures by."""
    return {
        "p_value": LIMIT,
        "nothing_at_most": NOTHING_AT_MOST,
        "tied": math.exp(TIED_NATS),
        "pareto_k": K_LIMIT,
        "r_hat": R_HAT_LIMIT,
        "ess": ESS_LIMIT,
        "practical_difference": PRACTICAL_DIFFERENCE,
        "influence_errs_by": ERRS_BY,
    }


def _profile_prior() -> dict[str, Any]:
    """What a force that is not in the list is thought to be like beforehand."""
    return {
        "kinds": [
            {"sd": kind.amplitude, "unit": kind.unit, "nil_at_typical_speed": kind.opposed} for kind in KINDS
        ],
        "sd_times": list(SCALES),
        "correlation_lengths_m": list(LENGTHS_M),
        "window_m": 2.0 * NEAR_M,
    }


def _calibrations(found: Outcome) -> list[dict[str, Any]]:
    """Convergence of each calibration, and of the predictions of avalanches left out."""
    if isinstance(found, NotDiagnosed):
        return [] if found.calibration is None else [_calibration([], found.calibration, None)]
    alone, same_errors = found.calibration, found.reference
    entries = [_calibration([], alone, found.before if same_errors is alone else None)]
    if same_errors is not alone:
        errors = cast(HierarchicalProblem, same_errors.problem).error_model.title
        entries.append(_calibration([], same_errors, found.before) | {"errors": errors})
    for number, step in enumerate(found.steps, start=1):
        held = found.after if number == len(found.steps) else None
        entries.append(_calibration(found.added[:number], step.calibration, held))
    return entries


def _calibration(added: Sequence[str], calibration: Calibration, held: HeldOut | None) -> dict[str, Any]:
    left_out = None
    if held is not None:
        left_out = {
            "pareto_k_max": largest_k([held]),
            "n_unreliable": held.n_unreliable,
            "refitted": list(held.refitted),
            "not_converged": list(held.not_converged),
        }
    return {"added": list(added), "gate": calibration.gate.as_dict(), "left_out": left_out}


def _parameters(found: Outcome) -> list[dict[str, Any]]:
    """All parameters, by the base law and by the augmented one, both under one error model."""
    after = found.steps[-1].calibration if isinstance(found, Diagnosis) and found.steps else None
    before = found.reference if isinstance(found, Diagnosis) else found.calibration
    added = set() if after is None else {one.name for one in augmented_of(after).added}
    rows: dict[str, dict[str, Any]] = {}
    for when, calibration in (("before", before), ("after", after)):
        if calibration is None:
            continue
        problem, posterior = calibration.problem, calibration.tree["posterior"].to_dataset()
        for parameter in problem.parameters(calibration.law):
            values = np.asarray(posterior[parameter.name].values, dtype=float)
            low, high = interval(values)
            empty = {
                "name": parameter.name, "symbol": parameter.symbol, "unit": parameter.unit,
                "added": parameter.name in added, "before": None, "after": None,
            }  # fmt: skip
            row = rows.setdefault(parameter.name, empty)
            row[when] = {
                "mean": float(values.mean()), "sd": float(values.std()), "low": low, "high": high,
            }  # fmt: skip
    return list(rows.values())


def _checks(found: Diagnosis) -> list[dict[str, Any]]:
    """The bootstrap test of the base law, and of each law with something added."""
    return [
        {
            "added": list(added),
            "p_value": check.p_value,
            "is_bound": check.is_bound,
            "fired": check.fired,
            "statistic": check.statistic,
            "n_simulated": len(check.simulated),
        }
        for added, check in checks_of(found)
    ]


def checks_of(found: Diagnosis) -> list[tuple[tuple[str, ...], BootstrapTest]]:
    """What was added, and the bootstrap test of the law with it; the base law's first."""
    checks: list[tuple[tuple[str, ...], BootstrapTest]] = [((), found.check)]
    checks += [(found.added[:number], step.check) for number, step in enumerate(found.steps, start=1)]
    if isinstance(found.finding, ProfileLaw):
        checks.append((found.added, found.finding.check))
    return checks


def _force(location: Location) -> dict[str, Any]:
    """The missing force along the track in numbers; its curves are in ``diagnosis.nc``."""
    return {
        "log_bayes_factor": location.log_bayes_factor,
        "resolution_m": location.resolution_m,
        "nil_at_typical_speed": location.opposed,
        "largest": float(np.abs(location.mean).max(initial=0.0)),
        "work": work_documents(location),
    }


def _comparison(comparison: Comparison, found: Diagnosis, number: int) -> dict[str, Any]:
    """One model comparison, and what was added from it."""
    added, tied = None, list[str]()
    if number < len(found.steps):
        step = found.steps[number]
        added, tied = step.candidate.mechanism.id, list(step.tied)
    return {
        "added": added,
        "tied_with": tied,
        "same_term": [name for name in tied if name != UNLISTED and mechanisms()[name].same_term_as == added],
        "probability": comparison.probability,
        "prior": comparison.odds,
        "log_bayes_factors": comparison.log_factors,
        "log_bayes_factors_se": {
            name: comparison.leading(name).errors[name] for name in comparison.odds if name != NOTHING
        },
        "error_models": [
            {
                "id": under_errors.error_model,
                "title": ERROR_MODELS[under_errors.error_model].title,
                "prior": ERROR_SHARES[under_errors.error_model],
                "log_evidence": comparison.base_evidence[under_errors.error_model],
                "log_bayes_factors": under_errors.log_factors,
            }
            for under_errors in comparison.under_each
        ],
        "candidates": {
            row["id"]: _candidate(comparison, row) for row in candidate_documents(found, comparison)
        },
    }


def _candidate(comparison: Comparison, row: dict[str, Any]) -> dict[str, Any]:
    """One mechanism where it has most of its evidence; its strength and place are those of the verdict."""
    best = comparison.leading(row["id"]).candidates[row["id"]].best
    told = {key: row[key] for key in ("strength", "location", "residue", "log_bayes_factor_by_itself")}
    return told | {"shape": _shape(best.shape)}


def _shape(shape: Shape) -> dict[str, Any]:
    """Where and how the most probable shape acts."""
    return {
        "s_from_m": shape.s_from_m,
        "s_to_m": shape.s_to_m,
        "sensor": shape.sensor,
        "covariate": shape.covariate,
        "constants": dict(shape.constants),
        "opposed": is_opposed(shape),
    }


def _added(found: Diagnosis, number: int) -> dict[str, Any]:
    """Of a mechanism added: its parameter in the augmented law, and how a covariate enters."""
    step = found.steps[number]
    shape = step.candidate.best.shape
    standard = standard_of_covariate(found, shape.covariate)
    return {
        "id": step.candidate.mechanism.id,
        "parameter": augmented_of(found.steps[-1].calibration).added[number].name,
        "symbol": step.candidate.mechanism.strength.symbol,
        "unit": step.candidate.mechanism.strength.unit,
        "shape": _shape(shape),
        "by_logarithm": standard is not None and standard["logarithm"],
    }


def _log_score(found: Diagnosis) -> dict[str, Any]:
    """Sums over the avalanches left out, and of how many the prediction became better."""
    before = found.before.pointwise
    after = None if found.after is None else found.after.pointwise
    return {
        "before": float(before.sum()),
        "after": None if after is None else float(after.sum()),
        "n_better": None if after is None else int(np.sum(after > before)),
        "n_events": len(before),
    }
