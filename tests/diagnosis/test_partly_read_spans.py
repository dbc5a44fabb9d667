"""Spans that fronts were read over up to where they stopped: in simulated campaigns and in predictions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skred.campaign import Status
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.predict.conditional import readings_of
from tests.diagnosis.diagnosis_cases import base_of, trial


@pytest.fixture(scope="module")
def base() -> Base:
    """The second span is noted 40 m further down, beyond the point below it, which some did not reach."""
    campaign = trial(9302, "sparse", "segment_friction", "coulomb", 10.0).campaign
    span = campaign.sensors[1]
    moved = replace(span, s_from_m=span.s_from_m + 40.0, s_to_m=span.s_to_m + 40.0)
    sensors = (campaign.sensors[0], moved, *campaign.sensors[2:])
    return base_of(replace(campaign, sensors=sensors), "coulomb")


def stopped_inside(base: Base, event: int) -> bool:
    """Whether a front was read over the second span, and is known to have stopped above its end."""
    campaign = base.problem.campaign
    status, stop = campaign.status[event], campaign.values[event, 3]
    above = status[3] == Status.OBSERVED and stop < campaign.sensors[1].s_to_m
    return bool(status[1] == Status.OBSERVED and (above or status[2] == Status.NOT_REACHED))


def test_replicas_are_read_over_the_same_part(base: Base) -> None:
    """As the instrument did with the recorded front; and no replica stops between two places in disorder."""
    campaign = base.problem.campaign
    _, span, point, _ = campaign.sensors
    partly = np.array([stopped_inside(base, event) for event in range(campaign.n_events)])
    assert 6 < partly.sum() < (campaign.status[:, 1] == Status.OBSERVED).sum()
    population, rng = base.population, np.random.default_rng(2)
    factor = np.linalg.cholesky(population.covariance)
    means, factors = (np.repeat(one, 40, axis=0) for one in (population.mean, factor))
    rows, _ = bootstrap_campaigns(base.extended(), base.strengths, means, factors, rng)
    readings = rows.readings
    assert np.all(readings.reached < readings.not_reached)
    own = (readings.values[:, 1] > 0.0) & (readings.not_reached == point.s_to_m)
    assert np.any(own & partly[rows.event]) and not np.any(own & ~partly[rows.event])
    assert np.all(readings.reached[own] == span.s_from_m)


def test_a_prediction_from_readings_above_knows_of_the_same_part(base: Base) -> None:
    campaign = base.problem.campaign
    sets = np.array([[False, False, False, False], [True, False, False, False], [True, True, False, False]])
    upper, span, *_ = campaign.sensors
    for event in np.flatnonzero(campaign.status[:, 1] == Status.OBSERVED).tolist():
        came = upper.s_to_m if campaign.status[event, 0] == Status.OBSERVED else -np.inf
        expected = [-np.inf, came, span.s_from_m if stopped_inside(base, event) else span.s_to_m]
        assert readings_of(base.problem, event, sets).reached.tolist() == expected
