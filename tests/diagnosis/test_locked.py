"""Locked avalanches and outer folds: unseen until they are scored, and scored by what was let in."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import gates_campaign, gates_diagnosis
from jsonschema import Draft202012Validator

from skred.campaign import Campaign, Status
from skred.campaign.parts import of_events, without_silent_sensors
from skred.cli.main import run
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import Effort
from skred.diagnosis.outcome import NotDiagnosed, Outcome
from skred.diagnosis.predict.unseen import Predictor, log_scores
from skred.diagnosis.repeated import folds_of, open_locked, outer_folds, set_aside
from skred.diagnosis.verdict.predictors import predictors_of
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.report.diagnosis.unseen import locked
from skred.report.diagnosis.unseen import outer_folds as told_folds
from skred.simulator.draw import draw_trial

N_LOCKED = 4
SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    campaign = draw_trial(1001, kind="sparse", hidden="nothing", base="constant").campaign
    return hierarchical_problem(of_events(campaign, range(14)))


def valid(key: str, document: dict[str, Any]) -> None:
    """As the schema of the verdict has it."""
    part = {"$defs": SCHEMA["$defs"], **SCHEMA["properties"][key]}
    Draft202012Validator(part).validate(json.loads(json.dumps(document, allow_nan=False)))


def test_locked_avalanches_are_not_there(problem: HierarchicalProblem) -> None:
    others, aside = set_aside(problem, N_LOCKED, 3)
    assert aside.n_events == N_LOCKED and others.campaign.n_events == problem.campaign.n_events - N_LOCKED
    assert set(aside.event_ids) | set(others.campaign.event_ids) == set(problem.campaign.event_ids)
    row = problem.campaign.event_ids.index(aside.event_ids[0])
    np.testing.assert_array_equal(aside.values[0], problem.campaign.values[row])
    again, other = (set_aside(problem, N_LOCKED, seed)[1] for seed in (3, 4))
    assert again.event_ids == aside.event_ids != other.event_ids
    assert others.terrain is problem.terrain and others.error_model is problem.error_model


def test_locked_avalanches_are_opened() -> None:
    """Those of a campaign with a biased sensor, which was found: they are predicted better with it."""
    found, aside = gates_diagnosis(biased=True), gates_campaign(range(13, 17), biased=True)
    document = open_locked(found, aside, 0)
    valid("locked", document)
    one, other = predictors_of(found)
    assert other is not None
    before, after = log_scores(one, aside), log_scores(other, aside)
    assert document["log_score_before"] == before.tolist()
    assert document["log_score_after"] == after.tolist()
    assert document["elpd_diff"] == pytest.approx((after - before).sum()) and document["elpd_diff"] > 5.0
    assert document["elpd_se"] == pytest.approx(np.sqrt(N_LOCKED) * (after - before).std(ddof=1))
    assert document["rmse_velocity_before"] > document["rmse_velocity_after"]
    assert document["rmse_runout_before"] > 0.0 and 0.0 <= document["coverage_90_before"] <= 1.0
    told = locked({"locked": document})
    assert told is not None and told["named"] and told["events"] == list(aside.event_ids)
    assert len(told["rows"]) == 3 + N_LOCKED


def test_nothing_let_in_leaves_nothing_to_compare() -> None:
    found, aside = gates_diagnosis(biased=False), gates_campaign(range(13, 14), biased=False)
    document = open_locked(found, aside, 0)
    valid("locked", document)
    assert len(document["log_score_before"]) == 1 and document["coverage_90_before"] is not None
    assert {document[key] for key in ("log_score_after", "elpd_diff", "elpd_se", "rmse_velocity_after")} == {
        None
    }
    unopened = open_locked(NotDiagnosed(found.problem, found.law, "too few"), aside, 0)
    valid("locked", unopened)
    assert unopened["events"] == list(aside.event_ids) and unopened["log_score_before"] is None
    told = locked({"locked": unopened})
    assert told is not None and told["rows"] == [] and not told["named"]


def test_a_fold_whose_numerics_broke_down_has_no_scores() -> None:
    """And the others keep theirs: hours of work."""
    problem = hierarchical_problem(gates_campaign(range(14), biased=True))
    found = gates_diagnosis(biased=True)
    outcomes = iter([NotDiagnosed(problem, found.law, "the numerics broke down in 'base'"), found, found])
    document = outer_folds(problem, 3, 0, lambda others: next(outcomes))
    valid("outer_folds", document)
    first, *others = document["folds"]
    assert first["verdict"] == "cannot_tell" and "broke down" in first["reason"]
    assert first["log_score_before"] == first["log_score_after"] == []
    assert document["elpd_diff"] == pytest.approx(sum(fold["elpd_diff"] for fold in others))
    assert document["elpd_diff"] > 0.0
    told = told_folds({"outer_folds": document})
    assert told is not None and len(told["rows"]) == 3


def test_numerics_that_break_down_after_the_base_law_leave_its_calibration(
    problem: HierarchicalProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = gates_diagnosis(biased=False).calibration
    monkeypatch.setattr("skred.diagnosis.diagnose.calibrate_surely", lambda *given: done)

    def broken(*given: Any) -> None:
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr("skred.diagnosis.diagnose.identify", broken)
    found = diagnose(problem, done.law, SamplerSettings(), Effort())
    assert isinstance(found, NotDiagnosed) and "broke down in 'identify'" in found.reason
    assert found.calibration is done


def test_every_fold_is_left_out_once() -> None:
    """By turns a diagnosis that found the biased sensor and one that found nothing."""
    problem = hierarchical_problem(gates_campaign(range(14), biased=True))
    seen: list[Campaign] = []

    def by_turns(others: HierarchicalProblem) -> Outcome:
        seen.append(others.campaign)
        return gates_diagnosis(biased=len(seen) % 2 == 1)

    document = outer_folds(problem, 3, 0, by_turns)
    valid("outer_folds", document)
    events = [event for fold in document["folds"] for event in fold["events"]]
    assert sorted(events) == sorted(problem.campaign.event_ids) and document["k"] == len(seen) == 3
    pairs = []
    for fold, campaign in zip(document["folds"], seen, strict=True):
        assert not set(fold["events"]) & set(campaign.event_ids)
        assert set(fold["events"]) | set(campaign.event_ids) == set(problem.campaign.event_ids)
        difference = np.subtract(fold["log_score_after"], fold["log_score_before"])
        assert fold["elpd_diff"] == pytest.approx(difference.sum())
        pairs += difference.tolist()
    assert [fold["mechanism"] for fold in document["folds"]] == ["sensor_bias", None, "sensor_bias"]
    assert document["folds"][1]["elpd_diff"] == 0.0 < document["folds"][0]["elpd_diff"]
    assert document["elpd_diff"] == pytest.approx(sum(pairs))
    assert document["elpd_se"] == pytest.approx(np.sqrt(len(pairs)) * np.std(pairs, ddof=1))
    told = told_folds({"outer_folds": document})
    assert told is not None and [row["names"] for row in told["rows"]][1] == "nothing"


@pytest.mark.parametrize("n", [9, 14, 40])
def test_too_few_are_left(problem: HierarchicalProblem, n: int) -> None:
    with pytest.raises(InputError, match="--lock"):
        set_aside(problem, n, 0)


def test_too_few_for_folds(problem: HierarchicalProblem) -> None:
    with pytest.raises(InputError, match="--outer-folds 20"):
        folds_of(problem, 20, 0)
    few = replace(problem, campaign=of_events(problem.campaign, range(8)))
    with pytest.raises(InputError, match="--outer-folds 2"):
        folds_of(few, 2, 0)
    assert len(folds_of(few, 8, 0)) == 8


def test_sensors_that_fall_silent_are_left_out(problem: HierarchicalProblem) -> None:
    """One that only a locked avalanche passed; that none reached it is not silence."""
    campaign = problem.campaign
    values, status = np.array(campaign.values), np.array(campaign.status)
    status[1:, 1], values[1:, 1] = Status.MISSING, np.nan
    status[:, 2], values[:, 2] = Status.NOT_REACHED, np.nan
    campaign = replace(campaign, values=values, status=status)
    rest = without_silent_sensors(of_events(campaign, range(1, 14)))
    assert rest.sensor_ids == tuple(np.delete(campaign.sensor_ids, 1))
    assert without_silent_sensors(campaign).sensor_ids == campaign.sensor_ids
    means, factors = np.full((5, 1), np.log(2.5)), np.full((5, 1, 1), 0.2)
    predictor = Predictor("constant", "robust", 8.0, 10.0, means, factors, (), np.empty((5, 0)))
    assert np.isfinite(log_scores(predictor, of_events(campaign, [0]))).all()


@pytest.mark.parametrize("words", [["--lock", "0"], ["--lock", "21"], ["--outer-folds", "1"]])
def test_the_command_refuses(
    words: list[str], tmp_path: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["diagnose", "--quiet", "--out", "told", *words]) == 2
    told = capsys.readouterr()
    assert "lock" in (told.err + told.out).lower() or "outer-folds" in (told.err + told.out).lower()
