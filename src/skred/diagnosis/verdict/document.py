"""The verdict as plain data: every key of the campaign format, and a statement in plain words."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.diagnosis.augment.coefficient import strength_of
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.decision import alarmed
from skred.diagnosis.detect.detectability import Detectability
from skred.diagnosis.diagnose import Diagnosis
from skred.diagnosis.evidence.covariates import standard_of
from skred.diagnosis.evidence.prior_odds import CALIBRATION_VERSION, NOTHING, POWER
from skred.diagnosis.predict.held_out import errors, paired
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.verdict.next_sensor import next_sensor
from skred.diagnosis.verdict.statement import statement
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.mechanisms.stretches import equation_of

_NO_LIMIT = 20.0
"""Strengths so many prior scales large are no limit: these recordings say nothing of the mechanism."""


def verdict(found: Diagnosis) -> dict[str, Any]:
    """The verdict of a diagnosis, as `verdict.json` holds it."""
    candidate = found.steps[0].candidate if found.steps else None
    names = found.decision.names if found.steps else ()
    document = {
        "format": 1,
        "campaign": found.problem.campaign.name,
        "base_model": found.law.id,
        "verdict": found.decision.verdict,
        "mechanism": names[0] if names else None,
        "mechanisms": [_mechanism(found, number) for number in range(len(found.steps))],
        "probability": found.comparison.probability if found.comparison is not None else {},
        "indistinguishable": list(names[1:]),
        "location": _location(found, candidate),
        "strength": _strength(found, 0) if found.steps else None,
        "covariate": candidate.best.shape.covariate if candidate is not None else None,
        "sensor": candidate.best.shape.sensor if candidate is not None else None,
        "equation": equation_of(candidate.mechanism, candidate.best.shape) if candidate is not None else None,
        "evidence": _evidence(found),
        "held_out": _held_out(found),
        "detection_limits": _detection_limits(found),
        "next_sensor": next_sensor(found),
        "diagnostics": _diagnostics(found),
        "left": _left(found),
    }
    document["statement"] = statement(found, document)
    return document | _more(found)


def _location(found: Diagnosis, candidate: Candidate | None) -> dict[str, float] | None:
    if candidate is not None:
        stretch = candidate.stretch()
    elif found.decision.verdict == "unexplained" and found.location is not None:
        stretch = found.location.stretch_m
    else:
        stretch = None
    return None if stretch is None else {"s_from_m": stretch[0], "s_to_m": stretch[1]}


def _strength(found: Diagnosis, number: int) -> dict[str, Any]:
    problem: Any = found.steps[-1].calibration.problem
    added = problem.added[number]
    mean, sd = strength_of(found.steps, number)
    return {"parameter": added.name, "unit": added.mechanism.strength.unit, "mean": mean, "sd": sd}


def _mechanism(found: Diagnosis, number: int) -> dict[str, Any]:
    """One mechanism let in, its strength as the last calibration has it."""
    step = found.steps[number]
    candidate = step.candidate
    stretch = candidate.stretch()
    shape = candidate.best.shape
    return {
        "id": candidate.mechanism.id,
        **_kind(candidate.mechanism),
        "strength": _strength(found, number),
        "location": None if stretch is None else {"s_from_m": stretch[0], "s_to_m": stretch[1]},
        "equation": equation_of(candidate.mechanism, shape),
        "covariate": shape.covariate,
        "standard": _standard(found, shape.covariate),
        "sensor": shape.sensor,
        "constants": dict(shape.constants),
        "tied_with": list(step.tied),
        "log_bayes_factor": step.comparison.log_factors[candidate.mechanism.id],
    }


def _kind(mechanism: Mechanism) -> dict[str, str]:
    """What a mechanism says is wrong and what it is bound to: a reader need not know its id."""
    assert mechanism.added is not None
    return {"group": str(mechanism.group), "bound_to": str(mechanism.added.bound_to)}


def _standard(found: Diagnosis, covariate: str | None) -> dict[str, Any] | None:
    """By what a covariate is standardised before its strength multiplies it."""
    standard = None if covariate is None else standard_of(found.problem.campaign.events, covariate)
    return None if standard is None else standard.as_dict()


def _evidence(found: Diagnosis) -> dict[str, float | None]:
    p_value = found.check.p_value if found.check is not None else None
    factor = None
    if found.comparison is not None and found.steps:
        factor = found.comparison.log_factors[found.steps[0].candidate.mechanism.id]
    elif found.comparison is not None:
        factor = found.comparison.log_odds
    difference, se = None, None
    if found.before is not None and found.after is not None:
        difference, se = paired(found.after, found.before)
    return {"elpd_diff": difference, "elpd_se": se, "log_bayes_factor": factor, "p_value": p_value}


def _held_out(found: Diagnosis) -> dict[str, Any]:
    keys = ("rmse_velocity", "rmse_runout", "coverage_90")
    result: dict[str, Any] = {"unit": "event"}
    for when, one in (("before", found.before), ("after", found.after)):
        values = errors(one, found.problem) if one is not None else dict.fromkeys(keys)
        result |= {f"{key}_{when}": values[key] for key in keys}
    return result


def _detection_limits(found: Diagnosis) -> dict[str, Any]:
    """The smallest strength found in 90 % of cases at a typical place."""
    if found.table is None:
        return {}
    return {
        row.mechanism.id: {
            "parameter": row.mechanism.strength.name,
            "unit": row.mechanism.strength.unit,
            "value": row.limit if row.limit < _NO_LIMIT * _scale(row) else None,
        }
        for row in found.table.rows
    }


def _scale(row: Detectability) -> float:
    assert row.mechanism.added is not None
    return row.mechanism.added.scale


def _diagnostics(found: Diagnosis) -> dict[str, float | int | None]:
    calibrations = [
        one
        for one in (found.calibration, found.reference, *(s.calibration for s in found.steps))
        if one is not None
    ]
    if not calibrations:
        return {"r_hat_max": None, "ess_min": None, "pareto_k_max": None, "divergences": None}
    gates = [one.gate for one in calibrations]
    held = [one.pareto_k.max() for one in (found.before, found.after) if one is not None]
    return {
        "r_hat_max": max(gate.r_hat_max for gate in gates),
        "ess_min": min(min(gate.ess_bulk_min, gate.ess_tail_min) for gate in gates),
        "pareto_k_max": float(np.max(held)) if held else None,
        "divergences": sum(gate.divergences for gate in gates),
    }


def _candidate(comparison: Comparison, name: str) -> dict[str, Any]:
    """One mechanism in the comparison, where and how strong it is if it is there."""
    candidate = comparison.leading(name).candidates[name]
    mean, sd = candidate.strength()
    stretch, shape = candidate.stretch(), candidate.best.shape
    return {
        "id": name,
        **_kind(candidate.mechanism),
        "log_bayes_factor": comparison.log_factors[name],
        "strength": {
            "parameter": candidate.mechanism.strength.name,
            "unit": candidate.mechanism.strength.unit,
            "mean": mean,
            "sd": sd,
        },
        "location": None if stretch is None else {"s_from_m": stretch[0], "s_to_m": stretch[1]},
        "covariate": shape.covariate,
        "sensor": shape.sensor,
        "estimators_differ_by": candidate.disagreement,
    }


def _left(found: Diagnosis) -> dict[str, Any] | None:
    """What a comparison of the augmented law leaned to and was not added; None where there was none."""
    if found.left.comparison is None:
        return None
    probability = found.left.comparison.probability
    first = max(probability, key=lambda name: probability[name])
    return {
        "most_probable": first,
        "probability": probability[first],
        "nothing": probability[NOTHING],
        "reason": found.left.reason or None,
    }


def _profile(law: ProfileLaw) -> dict[str, Any]:
    """The force profile at its knots, its equation's f(s); linear between, nothing outside."""
    profile = law.profile
    return {
        "equation": profile.kind.equation,
        "unit": profile.kind.unit,
        "s_m": profile.knots_m.tolist(),
        "mean": profile.mean.tolist(),
        "sd": np.sqrt(np.diag(profile.covariance)).tolist(),
        "prior_sd": profile.prior.amplitude,
        "correlation_length_m": profile.prior.length_m,
        "centre_m": profile.prior.centre_m,
        "log_bayes_factor": profile.log_bayes_factor,
    }


def _more(found: Diagnosis) -> dict[str, Any]:
    """Keys beyond the format's."""
    more: dict[str, Any] = {"reason": found.cannot or None, "seconds": found.seconds}
    if found.comparison is not None and found.check is not None:
        more["alarm"] = alarmed(found.comparison.probability, found.check.p_value)
        more["log_bayes_factors"] = found.comparison.log_factors
        more["calibration"] = {"version": CALIBRATION_VERSION, "power": POWER}
        more["error_models"] = [under_errors.error_model for under_errors in found.comparison.under_each]
        more["candidates"] = [
            _candidate(found.comparison, name) for name in found.comparison.under_each[0].candidates
        ]
    if found.steps:
        problem: Any = found.steps[-1].calibration.problem
        more["error_model"] = problem.error_model.id
        more["p_value_augmented"] = found.steps[-1].check.p_value
        more["refitted_events"] = list(found.after.refitted) if found.after is not None else []
    if found.profile is not None:
        more["error_model"] = found.profile.error_model
        more["p_value_augmented"] = found.profile.check.p_value
        more["profile"] = _profile(found.profile)
    if found.table is not None:
        more["identifiability"] = [
            {
                "id": row.mechanism.id,
                "kept": row.kept,
                "limit": row.limit,
                "best_limit": row.best_limit,
                "best_stretch_m": row.limit_m,
                "relevant": row.mechanism.added.relevant if row.mechanism.added is not None else None,
                "unit": row.mechanism.strength.unit,
                "power": row.power,
                "alike": list(row.alike),
            }
            for row in found.table.rows
        ]
        more["power"] = found.table.power
    if found.location is not None:
        more["missing_work_of"] = "fast front" if found.location.opposed else "typical front"
        more["missing_work"] = [
            {"s_from_m": a, "s_to_m": b, "mean": mean, "sd": sd, "unit": "J kg-1"}
            for a, b, mean, sd in found.location.work.tolist()
        ]
    return more
