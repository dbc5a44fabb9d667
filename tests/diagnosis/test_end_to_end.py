"""Whole diagnoses of an independent simulator's campaigns, and the predictions of what was left out."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import BIAS, BIASED_GATE, gates_campaign, gates_diagnosis
from numpy.testing import assert_allclose

from skred.campaign import Status
from skred.diagnosis.augment.reference import reference
from skred.diagnosis.augment.step import Augmented
from skred.diagnosis.evidence.predictive import Predicted
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.predict.held_out import HeldOut, elpd_difference, errors
from skred.diagnosis.verdict.document import verdict
from skred.diagnosis.verdict.report_facts import report_facts
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.leave_one_out import exact_leave_one_out
from skred.physics.mechanisms import mechanisms

KEYS = {
    "format", "campaign", "base_model", "verdict", "mechanism", "mechanisms", "probability",
    "indistinguishable", "location", "strength", "covariate", "sensor", "equation", "evidence", "held_out",
    "detection_limits", "next_sensor", "diagnostics", "statement",
}  # fmt: skip


@pytest.fixture(scope="module")
def clean() -> Diagnosis:
    return gates_diagnosis(biased=False)


@pytest.fixture(scope="module")
def biased() -> Diagnosis:
    """The third gate reads 45 % too high."""
    return gates_diagnosis(biased=True)


@pytest.mark.parametrize("which", ["clean", "biased"])
def test_verdict_has_every_key(which: str, request: pytest.FixtureRequest) -> None:
    document = json.loads(json.dumps(verdict(request.getfixturevalue(which)), allow_nan=False))
    assert set(document) >= KEYS
    probability = document["probability"]
    assert sum(probability.values()) == pytest.approx(1.0)
    assert {"nothing", "unlisted"} < set(probability) and set(probability) - {"nothing", "unlisted"} <= set(
        mechanisms()
    )
    assert set(document["detection_limits"]) == set(probability) - {"nothing", "unlisted"}
    assert set(document["evidence"]) == {"elpd_diff", "elpd_se", "log_bayes_factor", "p_value"}
    assert set(document["diagnostics"]) == {"r_hat_max", "ess_min", "pareto_k_max", "divergences"}
    held = document["held_out"]
    assert held["unit"] == "event" and {"rmse_velocity_before", "rmse_velocity_after"} <= set(held)
    assert document["diagnostics"]["r_hat_max"] < 1.02 and document["statement"].endswith(".")


@pytest.mark.parametrize("which", ["clean", "biased"])
def test_a_program_can_follow_the_probabilities(which: str, request: pytest.FixtureRequest) -> None:
    """From the verdict alone: the prior odds, in groups those of the format, the factors, and the power."""
    document = verdict(request.getfixturevalue(which))
    factors, power = document["log_bayes_factors"], document["calibration"]["power"]
    assert document["calibration"]["version"] == 2 and 0.5 < power < 1.0
    prior = document["calibration"]["prior"]
    faults = ("sensor_bias", "release_offset", "sensor_place")
    assert prior["nothing"] == pytest.approx(0.5) and prior["unlisted"] == pytest.approx(0.05)
    assert [prior[name] for name in faults] == pytest.approx([0.1 / 3.0] * 3)
    physics = [share for name, share in prior.items() if name not in ("nothing", "unlisted", *faults)]
    assert sum(physics) == pytest.approx(0.35) and set(prior) == set(factors)
    full = {name: share * np.exp(factors[name]) for name, share in prior.items()}
    nothing = full["nothing"] / sum(full.values())
    among = {
        name: share * np.exp(power * factors[name]) for name, share in prior.items() if name != "nothing"
    }
    expected = {name: (1.0 - nothing) * share / sum(among.values()) for name, share in among.items()}
    assert document["probability"] == pytest.approx(expected | {"nothing": nothing}, rel=1e-6)


def test_nothing_is_named_where_nothing_is(clean: Diagnosis) -> None:
    document = verdict(clean)
    assert document["verdict"] in ("nothing_missing", "cannot_tell")
    assert (document["verdict"] == "nothing_missing") == clean.table.can_tell
    assert document["mechanism"] is None and document["mechanisms"] == [] and document["strength"] is None
    assert document["evidence"]["p_value"] > 0.01 and clean.finding is None
    assert document["held_out"]["rmse_velocity_after"] is None


def test_a_biased_sensor_is_named(biased: Diagnosis) -> None:
    document = verdict(biased)
    assert document["verdict"] == "instrument" and document["mechanism"] == "sensor_bias"
    assert (
        document["sensor"] == biased.problem.campaign.sensors[BIASED_GATE].id
        and document["indistinguishable"] == []
    )
    strength = document["strength"]
    assert abs(strength["mean"] - np.log(BIAS)) < 4.0 * strength["sd"] + 0.02
    assert strength["parameter"] == "log_sensor_factor" and document["location"] is None
    assert document["mechanisms"][0]["id"] == "sensor_bias"
    assert document["evidence"]["elpd_diff"] > 20.0 and document["evidence"]["log_bayes_factor"] > 20.0
    held = document["held_out"]
    assert held["rmse_velocity_after"] < held["rmse_velocity_before"]
    assert document["sensor"] in document["statement"]


def test_limits_are_those_of_the_table(clean: Diagnosis) -> None:
    for row in clean.table.rows:
        found = verdict(clean)["detection_limits"][row.mechanism.id]
        assert found["unit"] == row.mechanism.strength.unit
        assert found["value"] is None or found["value"] == row.limit
    assert clean.table.power_with >= clean.table.power


def test_importance_sampling_agrees_with_refits(clean: Diagnosis) -> None:
    calibration: Any = clean.calibration
    assert clean.before.refitted == ()
    events = list(clean.problem.campaign.event_ids)
    exact = exact_leave_one_out(calibration.model, calibration.step, events, 5, which=[1, 4])
    assert exact.failed == ()
    assert_allclose(clean.before.pointwise[[1, 4]], exact.pointwise, atol=0.2)


def test_predictions_are_of_the_readings(clean: Diagnosis) -> None:
    found, problem = clean.before, clean.problem
    seen = problem.observed
    for values in found.predicted:
        assert np.isfinite(values[seen]).all() and np.isnan(values[~seen]).all()
    inside = (problem.values >= found.predicted.low) & (problem.values <= found.predicted.high)
    covered = errors(found, problem, "before")["coverage_90_before"]
    assert covered == inside[seen].mean() and 0.6 < covered <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robust", "scaled"])
def test_before_and_after_stand_under_one_error_model(biased: Diagnosis, name: str) -> None:
    """Else a left-out gain is the error model's as well as the mechanism's."""
    calibration: Any = biased.calibration
    base = replace(biased.problem, error_model=ERROR_MODELS[name])
    (step,) = biased.steps
    under: Any = replace(step.calibration.problem, error_model=base.error_model)
    under = replace(under, base=replace(under.base, problem=base))
    step = replace(step, calibration=replace(step.calibration, problem=under))
    found = reference(calibration, base)()
    problem: Any = found.problem
    assert found.gate.passed
    assert problem.error_model.id == name
    assert (found is calibration) == (name == "robust")
    assert isinstance(biased.finding, Augmented)
    finding = replace(biased.finding, steps=(step,), reference=found)
    diagnosis = replace(biased, finding=finding)
    assert verdict(diagnosis)["error_model"] == name
    facts = report_facts(diagnosis)
    for row in facts["parameters"]:
        if row["before"] is not None:
            draws = found.tree["posterior"].to_dataset()[row["name"]].values
            assert row["before"]["mean"] == pytest.approx(draws.mean())
    told = [(one["added"], one.get("errors"), one["left_out"] is not None) for one in facts["calibrations"]]
    if name == "robust":
        assert told[0] == ([], None, True)
    else:
        # What is predicted of avalanches left out stands by the calibration that predicts it.
        assert told[:2] == [([], None, False), ([], ERROR_MODELS[name].title, True)]
    if name != "robust":
        # Fewer than the 400 effective draws the gate asks for, even sixteen times as many from four chains.
        few = replace(calibration, settings=replace(calibration.settings, draws=5, tune=5))
        assert not reference(few, base)().gate.passed


def held(mean: np.ndarray, half_width: float) -> HeldOut:
    n, predicted = len(mean), Predicted(mean, mean - half_width, mean + half_width)
    return HeldOut(np.zeros(n), np.zeros(n), (), (), predicted)


def test_elpd_difference_by_hand() -> None:
    found = elpd_difference(np.array([1.0, 0.0, 2.0]))  # standard deviation 1
    assert found == {"elpd_diff": pytest.approx(3.0), "elpd_se": pytest.approx(np.sqrt(3.0) * 1.0)}
    assert elpd_difference(np.array([2.0])) == {"elpd_diff": 2.0, "elpd_se": None}
    assert elpd_difference(None) == {"elpd_diff": None, "elpd_se": None}


def test_errors_by_hand() -> None:
    campaign = gates_campaign(range(8), biased=False)
    problem = hierarchical_problem(campaign)
    predicted, seen = np.array(campaign.values), np.asarray(campaign.status) == Status.OBSERVED
    predicted[:, :-1] += 3.0
    predicted[:, -1] -= 20.0
    first = np.flatnonzero(seen[:, 0])
    predicted[first[0], 0] += 400.0  # 403 instead of 3, and the only one farther off than 50
    n_speeds = int(seen[:, :-1].sum())
    found = errors(held(predicted, 50.0), problem, "after")
    assert found["rmse_velocity_after"] == pytest.approx(
        np.sqrt((9.0 * (n_speeds - 1) + 403.0**2) / n_speeds)
    )
    assert found["rmse_runout_after"] == pytest.approx(20.0)
    assert found["coverage_90_after"] == pytest.approx(1.0 - 1.0 / seen.sum())
    status = np.full_like(campaign.status, Status.MISSING)
    silent = replace(problem, campaign=replace(campaign, values=np.full(seen.shape, np.nan), status=status))
    for nothing in (errors(held(predicted, 50.0), silent, "after"), errors(None, problem, "after")):
        assert nothing == dict.fromkeys(found)
