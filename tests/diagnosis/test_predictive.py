"""Predicted readings of one event: their 90 % intervals hold 90 % of such readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from error_cases import standardised_errors, within_binomial_limits

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.evidence.extension import Extension, extended
from skred.diagnosis.evidence.predictive import predict_event
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.laws import load_law

MEDIANS, SPREAD = np.log([0.2, 0.002]), 0.03
"""Fast avalanches, much alike, that pass every sensor: their readings scatter by their errors."""
EVENT = 0


@pytest.fixture(scope="module")
def ryggfonn() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def predictions(extension: Extension, n: int, rng: np.random.Generator) -> np.ndarray:
    points = np.column_stack([MEDIANS + SPREAD * rng.standard_normal((n, 2)), rng.standard_normal(n)])
    return extension.predict(np.full(n, EVENT), points, np.zeros(0))[:, :-1]


@pytest.mark.parametrize("name", ERROR_MODELS)
def test_intervals_cover_under_every_error_model(ryggfonn: HierarchicalProblem, name: str) -> None:
    """Against avalanches of the same population, read with errors that scipy draws."""
    problem = replace(ryggfonn, error_model=ERROR_MODELS[name])
    extension, rng = extended(problem, load_law("pcm")), np.random.default_rng(8)
    n, n_draws = 4000, 20_000
    fronts = predictions(extension, n, rng)
    sd = problem.readings.sd(EVENT, fronts)
    truths = fronts + sd * standardised_errors(name, problem.readings.is_velocity, n, rng)
    means, factors = np.tile(MEDIANS, (n_draws, 1)), np.tile(SPREAD * np.eye(2), (n_draws, 1, 1))
    found = predict_event(extension, EVENT, means, factors, np.zeros((n_draws, 0)), rng)
    for covered in found.covered(truths, np.full(truths.shape, True)).T:
        assert within_binomial_limits(covered)


@pytest.mark.parametrize("read", [30.0, 0.0])
def test_a_speed_that_was_read_is_predicted_by_fronts_that_come(
    ryggfonn: HierarchicalProblem, read: float
) -> None:
    """Else a right law would have errors of fronts that stop above, though nothing is read of them."""
    speeds, values = ryggfonn.readings.is_velocity, ryggfonn.campaign.values.copy()
    values[EVENT, speeds] = read
    problem = replace(ryggfonn, campaign=replace(ryggfonn.campaign, values=values))
    extension, rng, n = extended(problem, load_law("pcm")), np.random.default_rng(3), 20_000
    mean = np.log([0.45, 0.002])
    points = np.column_stack([mean + 0.3 * rng.standard_normal((n, 2)), rng.standard_normal(n)])
    fronts = extension.predict(np.full(n, EVENT), points, np.zeros(0))[:, :-1][:, speeds]
    assert 0.1 < (fronts > 0.0).mean(axis=0).min() < 0.9
    expected = [(one[one > 0.0] if read else one).mean() for one in fronts.T]
    draws = np.tile(mean, (n, 1)), np.tile(0.3 * np.eye(2), (n, 1, 1)), np.zeros((n, 0))
    found = predict_event(extension, EVENT, *draws, rng)
    np.testing.assert_allclose(found.mean[speeds], expected, rtol=0.03)
    assert (found.low[speeds] > 0.0).all() or not read
