"""A diagnosis of recordings of which some are known by bounds: replicates, slopes, and the whole of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import gates_campaign
from numpy.testing import assert_allclose
from test_score_information import MODELS, differences, readings_of

from skred.campaign import Campaign, Status
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import Effort
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.score_information import reading_slopes
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.verdict.document import verdict
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law

CONSTANT = load_law("constant")
INF = np.inf


def bounded_campaign(*, biased: bool = False) -> Campaign:
    """Eight avalanches past five gates; of some readings and runouts only sides are known."""
    campaign = gates_campaign(range(8), biased=biased)
    values, status = np.array(campaign.values), np.array(campaign.status)
    values_to = np.full(values.shape, np.nan)
    last = campaign.n_sensors - 1
    for event, change in ((0, -15.0), (3, -40.0)):
        values[event, last] += change
        status[event, last] = Status.AT_LEAST
    values[1, last] += 20.0
    status[1, last] = Status.AT_MOST
    values_to[5, last] = values[5, last] + 30.0
    values[5, last] -= 30.0
    status[5, last] = Status.BETWEEN
    seen = np.argwhere((status == Status.OBSERVED) & (values > 5.0) & (np.arange(last + 1) < last))
    for event, sensor in seen[::7]:
        values[event, sensor] -= 2.0
        status[event, sensor] = Status.AT_LEAST
    return replace(campaign, values=values, status=status, values_to=values_to)


@pytest.mark.parametrize("name", MODELS)
def test_slopes_with_bounds_are_the_derivatives(name: str) -> None:
    values = np.array([[21.0, np.nan, 480.0], [19.0, np.nan, np.nan], [30.0, np.nan, 500.0]])
    bounds = {"least": np.array([-INF, 12.0, -INF]), "most": np.array([INF, 16.0, INF])}
    errors = ERROR_MODELS[name].errors
    for given in (bounds, {"least": np.array([-INF, 25.0, -INF])}, {"most": np.array([INF, 4.0, INF])}):
        readings = readings_of(values, **given)
        predictions = np.array(
            [[20.0, 14.0, 490.0, 490.0], [22.0, 9.0, 470.0, 470.0], [24.0, 17.0, 495.0, 495.0]]
        )
        slope, curvature, _ = reading_slopes(np.arange(3), predictions, readings, errors)
        expected = differences(predictions, readings, errors)
        assert_allclose(slope[:, 1], expected[:, 1], rtol=1e-4, atol=1e-7)
        assert np.all(curvature[:, 1] >= 0.0)


def test_replicates_know_on_which_side_their_own_readings_lie() -> None:
    problem = hierarchical_problem(bounded_campaign())
    extension = extended(problem, CONSTANT)
    means = np.full((400, 1), np.log(2.5))
    rows, points = bootstrap_campaigns(
        extension, np.zeros(0), means, np.full((400, 1, 1), 0.4), np.random.default_rng(4)
    )
    bounded = problem.readings.bounded[rows.event]
    readings, last = rows.readings, problem.campaign.n_sensors - 1
    np.testing.assert_array_equal(readings.bounded, bounded)
    assert not readings.observed[bounded].any()
    cut = problem.campaign.values[0, last]
    of_first = rows.event == 0
    above = readings.least[of_first, last] == cut
    np.testing.assert_array_equal(readings.most[of_first, last] == cut, ~above)
    stops = extension.predict(rows.event, points, np.zeros(0))[of_first, -1]
    # Far on either side of the bound the reading's error decides nothing.
    assert above[stops > cut + 80.0].all() and not above[stops < cut - 80.0].any()
    assert 0.02 < above.mean() < 0.98
    low, high = problem.readings.least[5, last], problem.readings.most[5, last]
    of_interval = rows.event == 5
    sides = set(zip(readings.least[of_interval, last], readings.most[of_interval, last], strict=True))
    assert sides <= {(-INF, low), (low, high), (high, INF)} and len(sides) >= 2


@pytest.mark.slow
def test_a_diagnosis_with_bounds_finds_what_one_without_finds() -> None:
    settings, effort = SamplerSettings("metropolis", 500, 500, 4, 0), Effort(max_mechanisms=1)
    found = diagnose(hierarchical_problem(bounded_campaign(biased=True)), CONSTANT, settings, effort)
    assert isinstance(found, Diagnosis)
    said = verdict(found)
    assert said["verdict"] == "instrument" and said["mechanism"] == "sensor_bias"
    assert np.isfinite(said["evidence"]["log_bayes_factor"])
