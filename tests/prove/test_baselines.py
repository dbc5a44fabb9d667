"""Baselines: each answers in the format, the strong one names a strong effect, and a run resumes."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skred.campaign import Campaign, write_campaign
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.simulator.draw import draw_trial

NAMES = (
    "integral_regression",
    "sindy",
    "gaussian_process",
    "forward_bic",
    "posterior_predictive",
    "always_nothing",
    "random_class",
)
NEEDS = {"sindy": "pysindy", "gaussian_process": "sklearn"}
CHANCE = ("sindy", "posterior_predictive", "random_class")
"""What draws random numbers: seeded by the campaign."""
VERDICTS = ("missing_physics", "instrument", "unexplained", "nothing_missing")


@pytest.fixture(scope="module")
def runner() -> Iterator[Any]:
    """The command's module; it asks for one thread."""
    environment = dict(os.environ)
    try:
        yield importlib.import_module("benchmarks.run_baselines")
    finally:
        os.environ.clear()
        os.environ.update(environment)


@pytest.fixture(scope="module")
def baselines(runner: Any) -> Any:
    return importlib.import_module("benchmarks.baselines")


@pytest.fixture(scope="module")
def common(runner: Any) -> Any:
    return importlib.import_module("benchmarks.baselines.common")


@pytest.fixture(scope="module")
def sparse() -> Campaign:
    return _first_events(draw_trial(2_001, kind="sparse", hidden="nothing", base="pcm").campaign, 10)


@pytest.fixture(scope="module")
def dense() -> Campaign:
    """Profiles with a drag hidden that M1 lacks."""
    return draw_trial(2_003, kind="dense", hidden="turbulent_drag", base="coulomb", snr=11.0).campaign


def _first_events(campaign: Campaign, n: int) -> Campaign:
    return replace(
        campaign,
        events=campaign.events[:n],
        values=campaign.values[:n],
        status=campaign.status[:n],
        stated_sd=campaign.stated_sd[:n],
    )


def test_all_are_known(baselines: Any) -> None:
    assert tuple(baselines.BASELINES) == NAMES


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["sparse", "dense"])
def test_answers_are_in_the_format(
    baselines: Any, common: Any, name: str, kind: str, sparse: Campaign, dense: Campaign
) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    campaign, law = (sparse, "pcm") if kind == "sparse" else (_first_events(dense, 6), "coulomb")
    asked = baselines.baseline(name)
    answer = asked.answer(campaign, law)
    assert asked.id == name
    if name in CHANCE:
        assert answer == asked.answer(campaign, law)
    document = json.loads(json.dumps(answer.as_dict(), allow_nan=False))
    ids = set(common.possible(law))
    assert ids.isdisjoint({"coulomb_friction", "turbulent_drag"} if law == "pcm" else {"coulomb_friction"})
    assert document["verdict"] in VERDICTS and np.isfinite(document["score"])
    named = [document["mechanism"], *document["indistinguishable"]] if document["mechanism"] else []
    assert set(named[:1]) <= ids and set(named[1:]) <= ids | {"unlisted"} and len(named) == len(set(named))
    assert bool(named) == (document["verdict"] in ("missing_physics", "instrument"))
    if document["probability"]:
        assert set(document["probability"]) <= ids | {NOTHING, UNLISTED}
        assert {NOTHING, UNLISTED} <= set(document["probability"])
        assert sum(document["probability"].values()) == pytest.approx(1.0)
        assert min(document["probability"].values()) >= 0.0
    if document["location"] is not None:
        assert document["location"]["s_from_m"] < document["location"]["s_to_m"]


def test_a_strong_effect_is_named_by_integral_regression(baselines: Any, dense: Campaign) -> None:
    asked = baselines.baseline("integral_regression")
    answer = asked.answer(dense, "coulomb")
    assert answer.verdict == "missing_physics" and answer.mechanism == "turbulent_drag"
    # Where it is in the law, there is nothing left to name.
    assert asked.answer(dense, "pcm").verdict == "nothing_missing"


@pytest.mark.parametrize("layout", ["development", "proof"])
def test_a_run_resumes(runner: Any, sparse: Campaign, tmp_path: Path, layout: str) -> None:
    folder = tmp_path / "trials" if layout == "proof" else tmp_path
    for number in (1, 2):
        write_campaign(sparse, folder / f"trial-{number:04d}" / "campaign")
        (folder / f"trial-{number:04d}" / "request.json").write_text('{"base_model": "pcm"}\n')
    (folder / "trial-0002" / "request.json").write_text('{"base_model": "no such law"}\n')
    todo = runner.todo_of(tmp_path, ["always_nothing"])
    assert [job[1].name for job in todo] == ["trial-0001", "trial-0002"]
    first, second = (runner.answer_one(*job) for job in todo)
    assert first["verdict"] == "nothing_missing" and first["wall_seconds"] >= 0.0 <= first["cpu_seconds"]
    assert second["verdict"] == "crash" and "no such law" in second["error"]
    assert runner.todo_of(tmp_path, ["always_nothing"]) == []
    file = tmp_path / "answers" / "always_nothing" / "trial-0001.json"
    assert json.loads(file.read_text())["verdict"] == "nothing_missing"
    file.unlink()
    assert [job[2] for job in runner.todo_of(tmp_path, ["always_nothing"])] == [file]


def test_equal_terms_are_tied(common: Any) -> None:
    answer = common.nearest({"segment_drag": 0.9, "obstacle": 0.2}, "pcm", 2.0, 1.0, (1.0, 2.0))
    assert answer.mechanism == "segment_drag" and answer.indistinguishable == ("entrainment",)
    quiet = common.nearest({"segment_drag": 0.9, "obstacle": 0.2}, "pcm", 0.5, 1.0, (1.0, 2.0))
    assert quiet.verdict == "nothing_missing" and quiet.leading == "segment_drag"


def test_evidence_becomes_a_verdict(common: Any) -> None:
    strong = common.weighed({"sensor_bias": 12.0, "obstacle": 2.0}, "pcm", 0.0, 1.0, {})
    assert strong.verdict == "instrument" and strong.mechanism == "sensor_bias"
    weak = common.weighed({"sensor_bias": -1.0, "obstacle": -2.0}, "pcm", 0.0, 1.0, {})
    assert weak.verdict == "nothing_missing" and weak.probability[NOTHING] > 0.5
    cooler = common.weighed({"sensor_bias": 12.0, "obstacle": 2.0}, "pcm", 0.0, 4.0, {})
    assert cooler.score == pytest.approx(strong.score)
    assert cooler.probability["sensor_bias"] < strong.probability["sensor_bias"]
