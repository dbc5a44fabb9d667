"""The pooled density against the plain log likelihood, and its pullback against differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytensor
import pytensor.tensor as pt
import pytest
from numpy.testing import assert_allclose
from pytensor.gradient import verify_grad

from skred.inference.pooled.density import (
    MAX_NOT_REACHED,
    PooledArrays,
    pooled_arrays,
    pooled_log_density,
    pooled_log_density_pullback,
)
from skred.inference.pooled.density_op import PooledLogDensity
from skred.inference.pooled.recordings_covariance import observed_log_likelihood

N_SENSORS = 6
SD = np.array([9.0, 12.0, 11.0, 10.0, 8.0, 120.0])
CORRELATION = 0.75 ** np.abs(np.subtract.outer(np.arange(6.0), np.arange(6.0)))
COVARIANCE = CORRELATION * np.outer(SD, SD)
RESPONSE = np.array([[32.0, 24.0, 15.0, 9.0, 3.0, 1900.0], [25.0, 14.0, 4.0, 1.0, -2.0, 1840.0]])
READINGS = np.array([30.0, 20.0, 12.0, 7.0, 2.0, 1880.0])
PATTERNS = [
    "oooooo",
    "o-oo-o",
    "ooooxo",
    "oooxxo",
    "ooxxxo",
    "oxxxxo",
    "o-xxxo",
    "-----o",
    "xxxxo-",
    "xooooo",
]
"""Observed, missing (-), not reached (x)."""


def recordings() -> tuple[np.ndarray, np.ndarray]:
    codes = np.array([list(pattern) for pattern in PATTERNS])
    return np.where(codes == "o", READINGS, np.nan), codes == "x"


def arrays(scale: float = 1.0) -> PooledArrays:
    values, not_reached = recordings()
    release_of_event = np.arange(len(values)) % 2
    return pooled_arrays(values, np.isfinite(values), not_reached, release_of_event, scale * COVARIANCE)


def by_hand(response: np.ndarray, scale: float = 1.0) -> np.ndarray:
    values, not_reached = recordings()
    return np.array(
        [
            observed_log_likelihood(values[[e]], not_reached[[e]], response[e % 2], scale * COVARIANCE)
            for e in range(len(values))
        ]
    )


@pytest.mark.parametrize("scale", [1.0, 0.1])
@pytest.mark.parametrize("shift", [-15.0, 0.0, 15.0])
def test_density_is_the_plain_log_likelihood(shift: float, scale: float) -> None:
    response = RESPONSE + shift * np.array([1.0, 1.0, 1.0, 1.0, 1.0, 8.0])
    assert_allclose(
        pooled_log_density(response, arrays(scale)), by_hand(response, scale), rtol=1e-7, atol=1e-6
    )


def test_far_tails_stay_finite() -> None:
    """A response that reaches easily what was not reached: 20 standard deviations and more."""
    response = RESPONSE + np.array([0.0, 150.0, 150.0, 150.0, 150.0, 0.0])
    data = arrays()
    density = pooled_log_density(response, data)
    assert np.all(np.isfinite(density))
    assert_allclose(density, by_hand(response), rtol=1e-4)
    assert np.all(np.isfinite(pooled_log_density_pullback(np.ones(len(PATTERNS)), response, data)))


@pytest.mark.parametrize("shift", [-20.0, 0.0, 40.0])
def test_pullback_is_the_derivative(shift: float) -> None:
    data, response = arrays(), RESPONSE + shift
    cotangent = np.linspace(0.5, 2.0, len(PATTERNS))
    pulled = pooled_log_density_pullback(cotangent, response, data)
    for row, sensor in itertools.product(range(2), range(N_SENSORS)):
        step = np.zeros_like(response)
        step[row, sensor] = 1e-3 * SD[sensor]

        def at(times: float, step: np.ndarray = step) -> float:
            return float(cotangent @ pooled_log_density(response + times * step, data))

        slope = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step[row, sensor])
        assert_allclose(pulled[row, sensor], slope, rtol=1e-6, atol=1e-8)


def test_op_agrees_in_both_backends_and_with_verify_grad() -> None:
    data = arrays()
    response = pt.dmatrix("response")
    density = PooledLogDensity()(response, *data)
    for mode in ("NUMBA", "FAST_COMPILE"):
        value, gradient = pytensor.function(
            [response], [density, pt.grad(density.sum(), response)], mode=mode
        )(RESPONSE)
        assert_allclose(value, pooled_log_density(RESPONSE, data), rtol=1e-13)
        expected = pooled_log_density_pullback(np.ones(len(PATTERNS)), RESPONSE, data)
        assert_allclose(gradient, expected, rtol=1e-12)
    verify_grad(
        lambda x: PooledLogDensity()(x * SD, *data),
        [RESPONSE / SD],
        rng=np.random.default_rng(2),
        eps=1e-5,
        mode="FAST_COMPILE",
    )


def test_an_event_without_any_reading_says_nothing() -> None:
    nothing = np.full((1, N_SENSORS), np.nan)
    data = pooled_arrays(nothing, np.isfinite(nothing), nothing == 0, np.zeros(1, dtype=np.int64), COVARIANCE)
    assert_allclose(pooled_log_density(RESPONSE, data), 0.0)


def test_too_many_sensors_not_reached_are_refused() -> None:
    values, not_reached = np.full((2, N_SENSORS), np.nan), np.zeros((2, N_SENSORS), dtype=bool)
    not_reached[1, : MAX_NOT_REACHED + 1] = True
    with pytest.raises(ValueError, match="event number 2 did not reach 5 sensors"):
        pooled_arrays(values, np.isfinite(values), not_reached, np.zeros(2, dtype=np.int64), COVARIANCE)


def test_tightest_bound_last() -> None:
    """A sensor whose latent reading is far above zero, below others that are nearly at it."""
    values = np.where([True, False, False, False, False, False], READINGS, np.nan)[None]
    not_reached = np.array([[False, False, True, True, True, True]])
    data = pooled_arrays(values, np.isfinite(values), not_reached, np.zeros(1, dtype=np.int64), COVARIANCE)
    expected = observed_log_likelihood(values, not_reached, RESPONSE[0], COVARIANCE)
    assert_allclose(pooled_log_density(RESPONSE, data), expected, rtol=1e-5)
