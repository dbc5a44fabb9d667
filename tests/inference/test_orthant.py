"""Orthant probabilities and truncated moments against closed forms and one-dimensional integrals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import log_ndtr, logsumexp
from scipy.stats import truncnorm

from skred.inference.pooled.orthant import log_orthant_probability, truncate


def equicorrelated(d: int, rho: float) -> np.ndarray:
    return np.full((d, d), rho) + (1 - rho) * np.eye(d)


def log_probability_by_common_factor(d: int, rho: float, bound: np.ndarray) -> float:
    """x_i = sqrt(rho) t + sqrt(1 - rho) e_i: one integral over t, by a fine trapezoidal sum."""
    t, step = np.linspace(-45.0, 12.0, 60_001, retstep=True)
    below = log_ndtr((bound - math.sqrt(rho) * t[:, None]) / math.sqrt(1 - rho)).sum(axis=1)
    return float(logsumexp(below - 0.5 * t**2) + math.log(step) - 0.5 * math.log(2 * math.pi))


def test_orthants_with_known_angles() -> None:
    a, b, c = 0.3, -0.4, 0.5
    two = log_orthant_probability([0, 0], [[1, a], [a, 1]], [0, 0])
    assert_allclose(math.exp(two), 0.25 + math.asin(a) / (2 * math.pi), rtol=1e-9)
    covariance = np.array([[4, 2 * a, 6 * b], [2 * a, 1, 3 * c], [6 * b, 3 * c, 9]])
    three = log_orthant_probability([1, 2, 3], covariance, [1, 2, 3])
    expected = 0.125 + (math.asin(a) + math.asin(b) + math.asin(c)) / (4 * math.pi)
    assert_allclose(math.exp(three), expected, rtol=1e-7)
    four = log_orthant_probability(np.zeros(4), equicorrelated(4, 0.5), np.zeros(4))
    assert_allclose(math.exp(four), 0.2, rtol=1e-6)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
@pytest.mark.parametrize("rho", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("level", [-20.0, -6.0, -1.0, 2.0])
def test_log_probability_far_and_near(d: int, rho: float, level: float) -> None:
    bound = level + np.array([0.0, 1.5, -0.5, 0.7])[:d]
    found = log_orthant_probability(np.zeros(d), equicorrelated(d, rho), bound)
    tolerance = {1: 1e-12, 2: 1e-9, 3: 1e-7, 4: 1e-5}[d]
    assert_allclose(found, log_probability_by_common_factor(d, rho, bound), rtol=1e-12, atol=tolerance)


@pytest.mark.parametrize("limit", [-60.0, -31.0, -29.0, -3.0, 0.0, 5.0])
def test_moments_in_one_dimension(limit: float) -> None:
    result = truncate([1.0], [[4.0]], [1.0 + 2 * limit])
    mean, variance = truncnorm.stats(-np.inf, limit, moments="mv") if limit > -10 else (np.nan, np.nan)
    if limit <= -10:
        mean = limit + 1 / limit - 2 / limit**3 + 10 / limit**5
        variance = 1 / limit**2 - 6 / limit**4 + 50 / limit**6
    assert_allclose(result.mean[0], 1.0 + 2 * mean, rtol=1e-6)
    assert_allclose(result.covariance[0, 0], 4 * variance, rtol=1e-4)


@pytest.mark.parametrize("d", [2, 3, 4])
def test_moments_are_derivatives_of_the_log_probability(d: int) -> None:
    """The cumulant generating function is t m + t C t / 2 + log P(x <= b) for x ~ N(m + C t, C)."""
    rng = np.random.default_rng(d)
    root = rng.normal(size=(d, d))
    covariance, mean, bound = root @ root.T + 0.5 * np.eye(d), rng.normal(size=d), rng.normal(size=d) - 1
    result = truncate(mean, covariance, bound)
    step = 1e-3

    def tilted(t: np.ndarray) -> float:
        return log_orthant_probability(mean + covariance @ t, covariance, bound)

    unit = step * np.eye(d)
    first = np.array([(tilted(u) - tilted(-u)) / (2 * step) for u in unit])
    second = [
        [(tilted(u + v) - tilted(u - v) - tilted(v - u) + tilted(-u - v)) / (4 * step**2) for v in unit]
        for u in unit
    ]
    assert_allclose(result.mean, mean + first, rtol=1e-4, atol=1e-4)
    assert_allclose(result.covariance, covariance + np.array(second), rtol=1e-3, atol=2e-3)


def test_order_of_coordinates_does_not_matter() -> None:
    covariance = np.array([[1.0, 0.6, 0.2], [0.6, 2.0, -0.3], [0.2, -0.3, 0.5]])
    mean, bound, order = np.array([0.1, -1.0, 2.0]), np.array([0.0, 0.0, 0.0]), [2, 0, 1]
    one = truncate(mean, covariance, bound)
    other = truncate(mean[order], covariance[np.ix_(order, order)], bound[order])
    assert_allclose(other.log_probability, one.log_probability, rtol=1e-12)
    assert_allclose(other.mean, one.mean[order], rtol=1e-12)
    assert_allclose(other.covariance, one.covariance[np.ix_(order, order)], rtol=1e-10)


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="1 to 4 dimensions"):
        truncate(np.zeros(5), np.eye(5), np.zeros(5))
    with pytest.raises(np.linalg.LinAlgError):
        truncate([0, 0], [[1, 2], [2, 1]], [0, 0])
