"""Campaigns that cannot be diagnosed: a reason or silence, never a name, never a traceback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, first_events, trial, with_sensors
from numpy.testing import assert_allclose

from skred.campaign import Campaign, CampaignError, Sensor, Status, write_campaign
from skred.diagnosis.check.decision import decide
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.compare.location import locate
from skred.diagnosis.detect.detectability import told
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import Effort
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.verdict.document import verdict
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Mechanism


def small(n_events: int = 8) -> Campaign:
    """Clean: four gates and a runout."""
    campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, n_events)
    return with_sensors(campaign, [18, 20, 22, 24, campaign.n_sensors - 1])


def diagnosed(campaign: Campaign, problem: Any = None) -> dict[str, Any]:
    settings = SamplerSettings("metropolis", 300, 300, 4, 0)
    problem = problem or hierarchical_problem(campaign)
    found = diagnose(problem, load_law("constant"), settings, Effort(max_mechanisms=1))
    return verdict(found)


def assert_refused(document: dict[str, Any], words: str) -> None:
    assert document["verdict"] == "cannot_tell" and document["mechanism"] is None
    assert document["mechanisms"] == [] and document["indistinguishable"] == []
    assert words in document["reason"] and words in document["statement"]


def outcome(base: Base) -> tuple[str, tuple[str, ...]]:
    """ScoreTest, comparison, place and rule without the sampler."""
    score_test = ScoreTest(base)
    scores = score_test.scores(base.rows, base.fit.points, base.population)
    assert all(np.isfinite(one.log_factors).all() for one in score_test.by_id(scores).values())
    for row in told(score_test, scores):
        assert 0.0 <= row.power <= 1.0
    raced = compare(base)
    assert sum(raced.probability.values()) == pytest.approx(1.0)
    assert np.isfinite(list(raced.log_factors.values())).all()
    place = locate(raced.leading(UNLISTED))
    assert np.isfinite(place.mean).all() and np.isfinite(place.work).all()
    found = decide(raced.probability, 0.5, False)
    return found.verdict, found.names


def test_too_few_events() -> None:
    assert_refused(diagnosed(small(3)), "only 3 avalanches")


def test_one_sensor_only() -> None:
    assert_refused(diagnosed(with_sensors(small(), [2])), "only 1 sensor")


def test_no_reading_at_all() -> None:
    """Every avalanche stopped above every sensor: the problem says so before anything is tried."""
    campaign = small()
    values = np.full(campaign.values.shape, np.nan)
    is_runout = np.array([sensor.is_runout for sensor in campaign.sensors])
    status = np.where(is_runout, Status.MISSING, Status.NOT_REACHED) * np.ones((8, 1), dtype=int)
    with pytest.raises(ValueError, match="no reading is observed"):
        hierarchical_problem(replace(campaign, values=values, status=status, stated_sd=values))


@pytest.mark.slow
def test_a_gate_that_fails_gives_no_name() -> None:
    """Twenty draws are not enough, nor sixteen times as many: a verdict all the same, which says why."""
    settings = SamplerSettings("metropolis", 10, 10, 2, 0)
    found = diagnose(hierarchical_problem(small()), load_law("constant"), settings, Effort(max_mechanisms=1))
    assert_refused(verdict(found), "the gate of the base law's calibration failed")


class BreaksDown(HierarchicalProblem):
    """Recordings whose integration over events fails."""

    def surfaces(self, mechanisms: Sequence[Mechanism]) -> Any:
        raise np.linalg.LinAlgError("Matrix is not positive definite")


def test_numerics_that_break_down_give_no_name() -> None:
    problem = hierarchical_problem(small())
    document = diagnosed(small(), BreaksDown(problem.campaign, problem.terrain))
    assert_refused(document, "the numerics broke down in 'base': Matrix is not positive definite")


@pytest.mark.slow
def test_all_runouts_censored() -> None:
    campaign = small()
    status, values = np.array(campaign.status), np.array(campaign.values)
    status[:, -1], values[:, -1] = Status.MISSING, np.nan
    kind, names = outcome(base_of(replace(campaign, values=values, status=status), "constant"))
    assert kind in ("cannot_tell", "nothing_missing") and names == ()


def test_constant_covariate() -> None:
    """It divides by nothing: left out; one that differs is kept, standardised; 0 has no logarithm."""
    campaign = small()
    events = tuple(
        replace(event, covariates={"density_kg_m3": 250.0, "snow_type": "dry", "volume_m3": float(k)})
        for k, event in enumerate(campaign.events)
    )
    setting = setting_of(hierarchical_problem(replace(campaign, events=events)), load_law("constant"))
    assert list(setting.covariates) == ["volume_m3"]
    volume = setting.covariates["volume_m3"]
    assert volume.mean() == pytest.approx(0.0, abs=1e-12) and volume.std() == pytest.approx(1.0)


def test_a_volume_of_another_order_of_magnitude_does_not_decide_alone() -> None:
    """It enters by its logarithm, in which it is one of many; a temperature stays as it is."""
    campaign = small()
    volumes = [1.1e3, 2.3e3, 0.7e3, 5.2e3, 1.6e3, 3.1e3, 90e3]
    events = tuple(
        replace(event, covariates={"volume_m3": volumes[k % 7], "snow_degC": -1.0 - 0.5 * (k % 5)})
        for k, event in enumerate(campaign.events)
    )
    setting = setting_of(hierarchical_problem(replace(campaign, events=events)), load_law("constant"))
    logs = np.log([event.covariates["volume_m3"] for event in events])
    assert_allclose(setting.covariates["volume_m3"], (logs - logs.mean()) / logs.std(), atol=1e-12)
    raw = np.array([event.covariates["snow_degC"] for event in events], dtype=float)
    assert_allclose(setting.covariates["snow_degC"], (raw - raw.mean()) / raw.std(), atol=1e-12)


@pytest.mark.slow
def test_two_sensors_at_the_same_place() -> None:
    campaign = small()
    sensors = list(campaign.sensors)
    sensors[1] = replace(sensors[2], id=sensors[1].id)
    values, status = np.array(campaign.values), np.array(campaign.status)
    rng = np.random.default_rng(0)
    values[:, 1] = values[:, 2] * np.exp(0.03 * rng.standard_normal(len(values)))
    status[:, 1] = status[:, 2]
    kind, names = outcome(
        base_of(replace(campaign, sensors=tuple(sensors), values=values, status=status), "constant")
    )
    assert kind in ("cannot_tell", "nothing_missing") and names == ()


def flat(campaign: Campaign) -> Campaign:
    """A level stretch above: the first avalanche is released there and never starts."""
    x, z = np.array(campaign.track.x_m), np.array(campaign.track.z_m)
    level = 300.0
    track = replace(
        campaign.track,
        x_m=np.concatenate([[0.0], x + level]),
        z_m=np.concatenate([[z[0]], z]),
        width_m=None,
    )

    def moved(sensor: Sensor) -> Sensor:
        if sensor.is_runout:
            return sensor
        assert sensor.s_from_m is not None and sensor.s_to_m is not None
        return replace(sensor, s_from_m=sensor.s_from_m + level, s_to_m=sensor.s_to_m + level)

    values, status = np.array(campaign.values), np.array(campaign.status)
    values[:, -1] += level
    values[0], status[0] = np.nan, Status.NOT_REACHED
    status[0, -1] = Status.MISSING
    events = [replace(event, release_s_m=event.release_s_m + level) for event in campaign.events]
    events[0] = replace(events[0], release_s_m=100.0)
    return replace(
        campaign,
        track=track,
        sensors=tuple(moved(sensor) for sensor in campaign.sensors),
        events=tuple(events),
        values=values,
        status=status,
    )


@pytest.mark.slow
def test_an_event_that_never_starts() -> None:
    kind, names = outcome(base_of(flat(small()), "constant"))
    assert kind in ("cannot_tell", "nothing_missing") and names == ()


def two_runouts() -> Campaign:
    """No speed at all: how far each avalanche came, seen by two observers."""
    campaign = small()
    runout = campaign.sensors[-1]
    made = replace(with_sensors(campaign, [4, 4]), sensors=(runout, replace(runout, id="another runout")))
    values = np.array(made.values)
    values[:, 1] += 5.0 * np.random.default_rng(0).standard_normal(len(values))
    return replace(made, values=values)


@pytest.mark.slow
def test_two_runouts_and_no_speed() -> None:
    kind, names = outcome(base_of(two_runouts(), "constant"))
    assert kind in ("cannot_tell", "nothing_missing") and names == ()


@pytest.mark.slow
def test_absurd_speeds() -> None:
    """Half of the readings a hundred times too fast: no finite sense, no traceback, no piece of physics."""
    campaign = small()
    values = np.array(campaign.values)
    values[::2, :-1] *= 100.0
    document = diagnosed(replace(campaign, values=values))
    assert document["verdict"] in ("cannot_tell", "unexplained"), document["statement"]
    assert document["mechanism"] is None and document["statement"]


def test_readings_against_the_order_of_the_track_are_refused(tmp_path: Path) -> None:
    """Stopped above a sensor and yet fast at one further down: the reader says where."""
    campaign = small()
    values, status = np.array(campaign.values), np.array(campaign.status)
    values[0, 1], status[0, 1] = np.nan, Status.NOT_REACHED
    with pytest.raises(CampaignError, match=f"did not reach sensor '{campaign.sensors[1].id}'"):
        write_campaign(replace(campaign, values=values, status=status), tmp_path / "bad")
