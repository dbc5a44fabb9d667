"""Locked avalanches and outer folds: unseen until they are scored, and scored by what was let in."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import skred.diagnosis.repeated as module
from skred.campaign import Campaign, Status
from skred.campaign.parts import of_events, without_silent_sensors
from skred.cli.main import run
from skred.diagnosis.compare.decision import Decision
from skred.diagnosis.effort import Effort
from skred.diagnosis.outcome import Diagnosis, MechanismsAdded, NotDiagnosed, NothingAdded, Outcome
from skred.diagnosis.predict.unseen import Predictor, Term, log_scores
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Shape
from skred.report.diagnosis.unseen import locked, outer_folds
from skred.simulator.draw import draw_trial

SETTINGS, EFFORT = SamplerSettings("metropolis", 500, 500, 4, 0), Effort(40, 1)
N_LOCKED = 4
SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    campaign = draw_trial(1001, kind="sparse", hidden="nothing", base="constant").campaign
    return hierarchical_problem(of_events(campaign, range(14)))


def predictor(problem: HierarchicalProblem, bias: float | None = None) -> Predictor:
    """Of the law with one constant retardation, perhaps with a biased sensor."""
    means, factors = np.full((5, 1), np.log(2.5)), np.full((5, 1, 1), 0.2)
    if bias is None:
        return Predictor("constant", "robust", 8.0, 10.0, means, factors, (), np.empty((5, 0)))
    term = Term("sensor_bias", Shape(sensor=problem.campaign.sensors[0].id))
    return Predictor("constant", "robust", 8.0, 10.0, means, factors, (term,), np.full((5, 1), bias))


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch, problem: HierarchicalProblem) -> Iterator[list[Campaign]]:
    """Diagnoses made up, every other one lets a biased sensor in; what they saw is kept."""
    campaigns: list[Campaign] = []
    candidate: Any = SimpleNamespace(mechanism=SimpleNamespace(id="sensor_bias"))

    def made_up(problem: Any, law: Any, settings: Any, effort: Any, tell: Any = None) -> Diagnosis:
        campaigns.append(problem.campaign)
        step: Any = SimpleNamespace(candidate=candidate)
        held: Any = object()
        added = MechanismsAdded((step,), held, held) if len(campaigns) % 2 else NothingAdded()
        decision = Decision("instrument" if len(campaigns) % 2 else "nothing_missing", ())
        return Diagnosis(problem, law, held, held, held, held, held, decision, held, added, held)

    def predictors(found: Outcome) -> tuple[Predictor, Predictor | None]:
        added = isinstance(found, Diagnosis) and found.steps
        return predictor(problem), predictor(problem, 0.05) if added else None

    monkeypatch.setattr(module, "diagnose", made_up)
    monkeypatch.setattr(module, "predictors_of", predictors)
    yield campaigns


def valid(key: str, document: dict[str, Any]) -> None:
    """As the schema of the verdict has it."""
    part = {"$defs": SCHEMA["$defs"], **SCHEMA["properties"][key]}
    Draft202012Validator(part).validate(json.loads(json.dumps(document, allow_nan=False)))


def test_locked_avalanches_are_not_there(problem: HierarchicalProblem) -> None:
    others, aside = module.set_aside(problem, N_LOCKED, 3)
    assert aside.n_events == N_LOCKED and others.campaign.n_events == problem.campaign.n_events - N_LOCKED
    assert set(aside.event_ids) | set(others.campaign.event_ids) == set(problem.campaign.event_ids)
    row = problem.campaign.event_ids.index(aside.event_ids[0])
    np.testing.assert_array_equal(aside.values[0], problem.campaign.values[row])
    again, other = (module.set_aside(problem, N_LOCKED, seed)[1] for seed in (3, 4))
    assert again.event_ids == aside.event_ids != other.event_ids
    assert others.terrain is problem.terrain and others.error_model is problem.error_model


def test_locked_avalanches_are_opened(problem: HierarchicalProblem, seen: list[Campaign]) -> None:
    others, aside = module.set_aside(problem, N_LOCKED, 3)
    found = module.diagnose(others, load_law("constant"), SETTINGS, EFFORT)
    assert not set(seen[0].event_ids) & set(aside.event_ids)
    document = module.open_locked(found, aside, 0)
    valid("locked", document)
    before, after = log_scores(predictor(problem), aside), log_scores(predictor(problem, 0.05), aside)
    assert document["log_score_before"] == before.tolist()
    assert document["log_score_after"] == after.tolist()
    assert document["elpd_diff"] == pytest.approx((after - before).sum()) and document["elpd_diff"] != 0.0
    assert document["elpd_se"] == pytest.approx(np.sqrt(N_LOCKED) * (after - before).std(ddof=1))
    assert document["rmse_velocity_before"] != document["rmse_velocity_after"]
    assert document["rmse_runout_before"] > 0.0 and 0.0 <= document["coverage_90_before"] <= 1.0
    told = locked({"locked": document})
    assert told is not None and told["named"] and told["events"] == list(aside.event_ids)
    assert len(told["rows"]) == 3 + N_LOCKED


def test_nothing_let_in_leaves_nothing_to_compare(problem: HierarchicalProblem, seen: list[Campaign]) -> None:
    others, aside = module.set_aside(problem, 1, 3)
    found = module.diagnose(others, load_law("constant"), SETTINGS, EFFORT)
    assert isinstance(found, Diagnosis)
    nothing = replace(found, finding=NothingAdded())
    document = module.open_locked(nothing, aside, 0)
    valid("locked", document)
    assert len(document["log_score_before"]) == 1 and document["coverage_90_before"] is not None
    assert {document[key] for key in ("log_score_after", "elpd_diff", "elpd_se", "rmse_velocity_after")} == {
        None
    }
    unopened = module.open_locked(NotDiagnosed(others, found.law, "too few"), aside, 0)
    valid("locked", unopened)
    assert unopened["events"] == list(aside.event_ids) and unopened["log_score_before"] is None
    told = locked({"locked": unopened})
    assert told is not None and told["rows"] == [] and not told["named"]


def test_every_fold_is_left_out_once(problem: HierarchicalProblem, seen: list[Campaign]) -> None:
    document = module.outer_folds(problem, load_law("constant"), SETTINGS, EFFORT, 3)
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
    assert document["folds"][1]["elpd_diff"] == 0.0 != document["folds"][0]["elpd_diff"]
    assert document["elpd_diff"] == pytest.approx(sum(pairs))
    assert document["elpd_se"] == pytest.approx(np.sqrt(len(pairs)) * np.std(pairs, ddof=1))
    told = outer_folds({"outer_folds": document})
    assert told is not None and [row["names"] for row in told["rows"]][1] == "nothing"


@pytest.mark.parametrize("n", [9, 14, 40])
def test_too_few_are_left(problem: HierarchicalProblem, n: int) -> None:
    with pytest.raises(InputError, match="--lock"):
        module.set_aside(problem, n, 0)


def test_too_few_for_folds(problem: HierarchicalProblem) -> None:
    with pytest.raises(InputError, match="--outer-folds 20"):
        module.folds_of(problem, 20, 0)
    few = replace(problem, campaign=of_events(problem.campaign, range(8)))
    with pytest.raises(InputError, match="--outer-folds 2"):
        module.folds_of(few, 2, 0)
    assert len(module.folds_of(few, 8, 0)) == 8


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
    scores = log_scores(predictor(problem), of_events(campaign, [0]))
    assert np.isfinite(scores).all()


@pytest.mark.parametrize("words", [["--lock", "0"], ["--lock", "21"], ["--outer-folds", "1"]])
def test_the_command_refuses(
    words: list[str], tmp_path: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["diagnose", "--quiet", "--out", "told", *words]) == 2
    told = capsys.readouterr()
    assert "lock" in (told.err + told.out).lower() or "outer-folds" in (told.err + told.out).lower()
