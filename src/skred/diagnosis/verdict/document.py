"""The verdict as plain data: every key of the campaign format, and a statement in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from skred.diagnosis.augment.coefficient import augmented_of
from skred.diagnosis.augment.step import Left
from skred.diagnosis.detect.detectability import Identifiability
from skred.diagnosis.evidence.prior_odds import CALIBRATION_VERSION, NOTHING, POWER, SHARES
from skred.diagnosis.influence.influence import Few
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.held_out import HeldOut, elpd_difference, errors, largest_k
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.verdict.conditional import conditional_document
from skred.diagnosis.verdict.mechanisms import (
    added_document,
    candidate_documents,
    candidates_of,
    work_documents,
)
from skred.diagnosis.verdict.next_sensor import detection_sensor, next_sensor
from skred.diagnosis.verdict.stated_places import places_document
from skred.diagnosis.verdict.statement import statement
from skred.diagnosis.words import prior_note
from skred.inference.calibrate import Calibration
from skred.inference.hierarchical.problem import HierarchicalProblem

_OF_THE_NAMED = ("location", "strength", "covariate", "sensor", "equation")
"""Keys of a mechanism that the verdict has of the one that it names."""


def verdict(found: Outcome) -> dict[str, Any]:
    """The verdict of a diagnosis, as `verdict.json` holds it."""
    document = _told_nothing(found) if isinstance(found, NotDiagnosed) else _told(found)
    document["statement"] = f"{statement(found, document)} {prior_note(found.law)}".rstrip()
    document["changed_priors"] = dict(found.law.changed_priors)
    return document | _more(found)


def _told_nothing(found: Outcome) -> dict[str, Any]:
    """Every key of the format, as where no diagnosis was possible."""
    return {
        "format": 1,
        "campaign": found.problem.campaign.name,
        "base_model": found.law.id,
        "verdict": found.decision.verdict,
        "mechanism": None,
        "mechanisms": [],
        "probability": {},
        "indistinguishable": [],
        **dict.fromkeys(_OF_THE_NAMED),
        "evidence": dict.fromkeys(("elpd_diff", "elpd_se", "log_bayes_factor", "p_value")),
        "held_out": _held_out(found.problem, None, None),
        "detection_limits": {},
        "next_sensor": None,
        "diagnostics": _diagnostics([found.calibration] if found.calibration is not None else [], []),
        "left": None,
    }


def _told(found: Diagnosis) -> dict[str, Any]:
    """Every key of the format."""
    document = _told_nothing(found) | {
        "mechanisms": [added_document(found, number) for number in range(len(found.steps))],
        "probability": found.comparison.probability,
        "indistinguishable": list(found.decision.tied),
        "evidence": _evidence(found),
        "held_out": _held_out(found.problem, found.before, found.after),
        "detection_limits": _detection_limits(found.table),
        "next_sensor": next_sensor(found),
        "diagnostics": _diagnostics(
            [found.calibration, found.reference, *(step.calibration for step in found.steps)],
            [found.before] if found.after is None else [found.before, found.after],
        ),
        "left": _left(found.left),
    }
    if found.decision.verdict == "unexplained":
        first, last = found.location.stretch_m
        ends = {"s_from_m": first, "s_to_m": last, "s_from_interval_m": None, "s_to_interval_m": None}
        document["location"] = ends
    if document["mechanisms"]:
        named = document["mechanisms"][0]
        document |= {"mechanism": named["id"]} | {key: named[key] for key in _OF_THE_NAMED}
    return document


def _evidence(found: Diagnosis) -> dict[str, float | None]:
    factor = found.comparison.log_odds
    if found.steps:
        factor = found.comparison.log_factors[found.steps[0].candidate.mechanism.id]
    pairs = None if found.after is None else found.after.pointwise - found.before.pointwise
    return {
        **elpd_difference(pairs),
        "log_bayes_factor": factor,
        "p_value": found.check.p_value,
    }


def _held_out(problem: HierarchicalProblem, before: HeldOut | None, after: HeldOut | None) -> dict[str, Any]:
    return {"unit": "event", **errors(before, problem, "before"), **errors(after, problem, "after")}


def _detection_limits(table: Identifiability) -> dict[str, Any]:
    """The smallest strength found in 90 % of cases at a typical place."""
    return {
        row.mechanism.id: {
            "parameter": row.mechanism.strength.name,
            "unit": row.mechanism.strength.unit,
            "value": row.as_dict()["limit"],
        }
        for row in table.rows
    }


def _diagnostics(
    calibrations: Sequence[Calibration], held: Sequence[HeldOut]
) -> dict[str, float | int | None]:
    gates = [one.gate for one in calibrations]
    if not gates:
        return {"r_hat_max": None, "ess_min": None, "pareto_k_max": None, "divergences": None}
    return {
        "r_hat_max": max(gate.r_hat_max for gate in gates),
        "ess_min": min(min(gate.ess_bulk_min, gate.ess_tail_min) for gate in gates),
        "pareto_k_max": largest_k(held),
        "divergences": sum(gate.divergences for gate in gates),
    }


def _left(left: Left | None) -> dict[str, Any] | None:
    """What a comparison of the augmented law leaned to and was not added; None where there was none."""
    if left is None:
        return None
    probability = left.comparison.probability
    # Where nothing more has less than its prior probability, what else is most probable.
    could = set(probability) - ({NOTHING} if probability[NOTHING] < SHARES[NOTHING] else set())
    first = max(could, key=lambda name: probability[name])
    candidate = candidates_of(left.comparison).get(first)  # none where that is nothing, or not in the list
    return {
        "most_probable": first,
        "covariate": candidate and candidate.best.shape.covariate,
        "sensor": candidate and candidate.best.shape.sensor,
        "probability": probability[first],
        "nothing": probability[NOTHING],
        "reason": left.reason or None,
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


def _more(found: Outcome) -> dict[str, Any]:
    """Keys beyond the format's."""
    more: dict[str, Any] = {
        "reason": found.reason or None,
        "converged": found.converged,
        "refits_not_converged": list(found.refits_not_converged),
        "seconds": found.seconds,
    }
    if isinstance(found, NotDiagnosed):
        return more | {"alarm_by": None, "influence": None, "conditional": None, "sensor_places": None}
    more |= {
        "alarm": found.alarm_by is not None,
        "alarm_by": found.alarm_by,
        "log_bayes_factors": found.comparison.log_factors,
        "calibration": {"version": CALIBRATION_VERSION, "power": POWER, "prior": found.comparison.odds},
        "error_models": [under_errors.error_model for under_errors in found.comparison.under_each],
        "candidates": candidate_documents(found, found.comparison),
        "influence": _influence(found),
        "conditional": conditional_document(found),
        "sensor_places": places_document(found),
        **_with_what_was_added(found),
        "identifiability": [row.as_dict() for row in found.table.rows],
        "power": found.table.power,
        "detection_sensor": detection_sensor(found.table),
    }
    if found.alarm_by is not None:
        more["missing_work_of"] = "fast front" if found.location.opposed else "typical front"
        more["missing_work"] = work_documents(found.location)
    return more


def _with_what_was_added(found: Diagnosis) -> dict[str, Any]:
    """Under which errors something was added, and what the check says of the law with it."""
    if isinstance(found.finding, ProfileLaw):
        return {
            "error_model": found.finding.error_model,
            "p_value_augmented": found.finding.check.p_value,
            "profile": _profile(found.finding),
        }
    if found.after is None:
        return {}
    last = found.steps[-1]
    return {
        "error_model": augmented_of(last.calibration).error_model.id,
        "p_value_augmented": last.check.p_value,
        "refitted_events": list(found.after.refitted),
    }


def _influence(outcome: Diagnosis) -> dict[str, Any] | None:
    """What the answer hangs on; None where none is given."""
    found = outcome.influence
    if found is None:
        return None
    return {
        "answer": found.answer,
        "error_model": outcome.comparison.leading(found.answer).error_model,
        "log_bayes_factor": found.log_bayes_factor,
        "needed": found.needed,
        "events": [
            {"event": event, "log_bayes_factor": factor}
            for event, factor in zip(found.events, found.without_each.tolist(), strict=True)
        ],
        "carried_by": list(found.carried_by),
        "without_them": found.without_them,
        "alarm": _few(found.few),
        "without_a_third": found.without_a_third,
        "readings": [asdict(one) for one in found.readings],
        "rival": found.rival and {"id": found.rival.id, "ahead": found.rival.ahead, **_few(found.rival.few)},
    }


def _few(found: Few | None) -> dict[str, Any]:
    """Avalanches without which something does not hold, and what is left without them."""
    return {"carried_by": list(found.events) if found else [], "without_them": found.left if found else None}
