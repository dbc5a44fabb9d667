"""The recordings' covariance: closed form, recovery, and direct maximisation as a second route."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from skred.inference.pooled.recordings_covariance import (
    em_step,
    observed_log_likelihood,
    recordings_covariance,
)

MEAN = np.array([30.0, 20.0, 8.0, 20.0])
SD = np.array([9.0, 12.0, 11.0, 120.0])
CORRELATION = np.array(
    [[1.0, 0.8, 0.6, 0.6], [0.8, 1.0, 0.85, 0.7], [0.6, 0.85, 1.0, 0.8], [0.6, 0.7, 0.8, 1.0]]
)
COVARIANCE = CORRELATION * np.outer(SD, SD)


def campaign(
    n_events: int, n_sensors: int = 4, missing: float = 0.15, seed: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """Readings of which negative speeds were not reached and others got lost; runout is the last."""
    rng = np.random.default_rng(seed)
    values = rng.multivariate_normal(MEAN, COVARIANCE, n_events)[:, -n_sensors:]
    not_reached = values <= 0
    not_reached[:, -1] = False
    lost = rng.random(values.shape) < missing
    not_reached &= ~lost
    values[lost | not_reached] = np.nan
    return values, not_reached


def test_complete_data_give_the_sample_moments() -> None:
    values = np.random.default_rng(1).multivariate_normal(MEAN, COVARIANCE, 40)
    nowhere = np.zeros_like(values, dtype=bool)
    mean, covariance = recordings_covariance(values, nowhere)
    assert_allclose(mean, values.mean(axis=0), rtol=1e-12)
    assert_allclose(covariance, np.cov(values.T, ddof=0), rtol=1e-9)
    log_likelihood = observed_log_likelihood(values, nowhere, mean, covariance)
    assert_allclose(log_likelihood, multivariate_normal(mean, covariance).logpdf(values).sum(), rtol=1e-12)


def test_one_missing_column_by_regression() -> None:
    """Monotone missingness has a closed form: regress the incomplete sensor on the complete one."""
    values = np.random.default_rng(5).multivariate_normal(MEAN[:2], COVARIANCE[:2, :2], 30)
    values[20:, 1] = np.nan
    mean, covariance = recordings_covariance(values, np.zeros_like(values, dtype=bool))
    x, both = values[:, 0], values[:20]
    slope = np.cov(both.T)[0, 1] / np.var(both[:, 0], ddof=1)
    residual = np.var(both[:, 1] - slope * both[:, 0])
    assert_allclose(mean, [x.mean(), both[:, 1].mean() + slope * (x.mean() - both[:, 0].mean())], rtol=1e-8)
    variance = [[x.var(), slope * x.var()], [slope * x.var(), residual + slope**2 * x.var()]]
    assert_allclose(covariance, variance, rtol=1e-7)


@pytest.mark.slow
def test_simulated_moments_are_recovered() -> None:
    values, not_reached = campaign(500, missing=0.1)
    assert not_reached.sum() > 100
    mean, covariance = recordings_covariance(values, not_reached)
    assert np.all(np.abs(mean - MEAN) < 4.5 * SD / np.sqrt(500))
    sd = np.sqrt(np.diag(covariance))
    assert_allclose(sd, SD, rtol=0.12)
    assert_allclose(covariance / np.outer(sd, sd), CORRELATION, atol=0.1)
    # Taking the positive readings for all there are would have said otherwise.
    assert np.nanmean(values[:, 2]) > MEAN[2] + 2.0


@pytest.mark.parametrize("n_sensors", [2, 3])
def test_direct_maximisation_finds_the_same(n_sensors: int) -> None:
    values, not_reached = campaign(25, n_sensors, seed=11)
    mean, covariance = recordings_covariance(values, not_reached)
    scale = SD[-n_sensors:]
    lower = np.tril_indices(n_sensors)

    def unpack(parameter: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        factor = np.zeros((n_sensors, n_sensors))
        factor[lower] = parameter[n_sensors:]
        factor *= scale[:, None]
        return parameter[:n_sensors] * scale, factor @ factor.T

    def loss(parameter: np.ndarray) -> float:
        return -observed_log_likelihood(values, not_reached, *unpack(parameter))

    start = np.concatenate([MEAN[-n_sensors:] / scale, np.eye(n_sensors)[lower]])
    direct = minimize(loss, start, method="BFGS", options={"gtol": 1e-4})
    direct_mean, direct_covariance = unpack(direct.x)
    assert_allclose(-direct.fun, observed_log_likelihood(values, not_reached, mean, covariance), atol=1e-6)
    assert_allclose(direct_mean / scale, mean / scale, atol=1e-3)
    unit = np.outer(scale, scale)
    assert_allclose(direct_covariance / unit, covariance / unit, atol=2e-3)


def test_likelihood_rises_with_every_step() -> None:
    values, not_reached = campaign(30, seed=8)
    mean, covariance = np.nanmean(values, axis=0), np.diag(np.nanvar(values, axis=0))
    trace = []
    for _ in range(60):
        trace.append(observed_log_likelihood(values, not_reached, mean, covariance))
        mean, covariance, reported = em_step(values, not_reached, mean, covariance)
        assert_allclose(reported, trace[-1], rtol=1e-12)
    assert np.all(np.diff(trace) > -1e-9)
    assert trace[-1] > trace[0] + 1


def test_units_and_order_of_events_do_not_matter() -> None:
    values, not_reached = campaign(25, seed=4)
    mean, covariance = recordings_covariance(values, not_reached)
    unit = np.array([3.6, 1.0, 100.0, 1e-3])
    scaled_mean, scaled_covariance = recordings_covariance((values * unit)[::-1], not_reached[::-1])
    assert_allclose(scaled_mean, mean * unit, rtol=1e-6)
    assert_allclose(scaled_covariance, covariance * np.outer(unit, unit), rtol=1e-6)


def test_data_that_cannot_determine_it_are_refused() -> None:
    values, not_reached = campaign(25, seed=4)
    unseen = values.copy()
    unseen[:, 2] = np.nan
    with pytest.raises(ValueError, match=r"sensor number 3: fewer than two"):
        recordings_covariance(unseen, not_reached)
    with pytest.raises(ValueError, match="needs at least 5"):
        recordings_covariance(values[:4], not_reached[:4])
    with pytest.raises(ValueError, match="singular"):
        recordings_covariance(values[:, [0, 3, 3]], not_reached[:, [0, 3, 3]])
    with pytest.raises(ValueError, match="there is none where"):
        recordings_covariance(values, np.isfinite(values))
    with pytest.raises(ValueError, match="two .event, sensor. arrays"):
        recordings_covariance(values, not_reached[:, :2])
