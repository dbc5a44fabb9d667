"""The pooled log density in numba: one value for each event; missing readings drop out, stops are censored.

For every event the observed readings are whitened by the Cholesky factor of their own block of
Sigma. Sensors it did not reach add the probability that their latent readings, given the observed
ones, are all at most 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_legendre

from skred.parallel.compile_cache import compiled, inner

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
MAX_NOT_REACHED = 4
"""Sensors an event may have missed; each beyond the first multiplies the work by the nodes."""

_NODE, _WEIGHT = (np.ascontiguousarray(a) for a in roots_legendre(24))
_SQRT_HALF = math.sqrt(0.5)
_INV_SQRT_2PI = 1.0 / math.sqrt(2.0 * math.pi)


class PooledArrays(NamedTuple):
    """The recordings as the density reads them, made by `pooled_arrays`.

    Attributes
    ----------
    release_of_event : (n_events,) integer array
        Row of the mean response that an event is compared with.
    readings : (n_events, n_sensors) array, m/s or m
        0 where there is none.
    whiten : (n_events, n_sensors, n_sensors) array
        Inverse Cholesky factor of Sigma over the observed readings, zero elsewhere.
    constant : (n_events,) array
        Log determinant and powers of 2 pi.
    n_stopped : (n_events,) integer array
        How many sensors the event did not reach.
    stopped : (n_events, MAX_NOT_REACHED) integer array
        Which ones.
    regression : (n_events, MAX_NOT_REACHED, n_sensors) array
        Of their latent readings on the residuals of the observed ones.
    conditional : (n_events, MAX_NOT_REACHED, MAX_NOT_REACHED) array
        Their covariance given the observed ones.
    """

    release_of_event: NDArray[np.int64]
    readings: FloatArray
    whiten: FloatArray
    constant: FloatArray
    n_stopped: NDArray[np.int64]
    stopped: NDArray[np.int64]
    regression: FloatArray
    conditional: FloatArray


def pooled_arrays(
    values: FloatArray,
    observed: BoolArray,
    not_reached: BoolArray,
    release_of_event: NDArray[np.int64],
    covariance: FloatArray,
) -> PooledArrays:
    """Arrays of the density for one pattern of gaps; arguments as in `PooledProblem`.

    Raises
    ------
    ValueError
        If an event did not reach more than `MAX_NOT_REACHED` sensors.
    """
    n_events, n_sensors = values.shape
    whiten = np.zeros((n_events, n_sensors, n_sensors))
    constant = np.zeros(n_events)
    stopped = np.zeros((n_events, MAX_NOT_REACHED), dtype=np.int64)
    regression = np.zeros((n_events, MAX_NOT_REACHED, n_sensors))
    conditional = np.zeros((n_events, MAX_NOT_REACHED, MAX_NOT_REACHED))
    n_stopped = not_reached.sum(axis=1).astype(np.int64)
    if n_stopped.max(initial=0) > MAX_NOT_REACHED:
        raise ValueError(
            f"event number {int(n_stopped.argmax()) + 1} did not reach {n_stopped.max()} sensors; the pooled"
            f" likelihood takes up to {MAX_NOT_REACHED}: leave out some of the lower sensors"
        )
    for event in range(n_events):
        seen, missed = np.flatnonzero(observed[event]), np.flatnonzero(not_reached[event])
        own = np.linalg.cholesky(covariance[np.ix_(seen, seen)])
        inverse = np.linalg.inv(own)
        whiten[event][np.ix_(np.arange(len(seen)), seen)] = inverse
        constant[event] = -np.log(np.diag(own)).sum() - 0.5 * len(seen) * np.log(2.0 * np.pi)
        across = inverse @ covariance[np.ix_(seen, missed)]
        stopped[event, : len(missed)] = missed
        regression[event][np.ix_(np.arange(len(missed)), seen)] = across.T @ inverse
        conditional[event, : len(missed), : len(missed)] = (
            covariance[np.ix_(missed, missed)] - across.T @ across
        )
    readings = np.where(observed, values, 0.0)
    return PooledArrays(
        np.asarray(release_of_event, dtype=np.int64),
        readings,
        whiten,
        constant,
        n_stopped,
        stopped,
        regression,
        conditional,
    )


@inner()
def _normal_cdf(x):  # type: ignore[no-untyped-def]
    return 0.5 * math.erfc(-x * _SQRT_HALF)


@inner()
def _bound(level, mean, factor, z):  # type: ignore[no-untyped-def]
    """Largest z_level with x_level <= 0, given the z above it."""
    bound = -mean[level]
    for j in range(level):
        bound -= factor[level, j] * z[j]
    return bound / factor[level, level]


@inner()
def _stretch(bound):  # type: ignore[no-untyped-def]
    """Upper end and width of the stretch below a bound that holds its probability to e^-36."""
    upper = min(bound, 8.5)
    return upper, (upper + 8.5 if upper > 0.0 else upper + math.sqrt(upper * upper + 72.0))


@inner()
def _tightest_first(size, mean, covariance):  # type: ignore[no-untyped-def]
    """Mean and Cholesky factor with the largest mean in standard deviations first.

    The nodes then lie where the probability is, also in the far tail.
    """
    left = np.empty(size, dtype=np.int64)
    for k in range(size):
        left[k] = k
    for k in range(size):
        for other in range(k + 1, size):
            a, b = left[k], left[other]
            if mean[b] / math.sqrt(covariance[b, b]) > mean[a] / math.sqrt(covariance[a, a]):
                left[k], left[other] = b, a
    ordered, factor = np.empty(size), np.zeros((size, size))
    for i in range(size):
        ordered[i] = mean[left[i]]
        for j in range(i + 1):
            rest = covariance[left[i], left[j]]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(rest) if i == j else rest / factor[j, j]
    return ordered, factor


@inner()
def _orthant(size, unordered, covariance):  # type: ignore[no-untyped-def]
    """P(x_1 <= 0, ..., x_size <= 0) for x ~ N(unordered, covariance).

    Nested Gauss-Legendre over all z but the last, each on the stretch that holds the probability,
    so that it works in the far tail as well. A loop over levels: numba cannot cache a recursion.
    """
    mean, factor = _tightest_first(size, unordered, covariance)
    last = size - 1
    z, upper, width = np.zeros(size), np.zeros(size), np.zeros(size)
    total, node = np.zeros(size), np.zeros(size, dtype=np.int64)
    level = 0
    upper[0], width[0] = _stretch(_bound(0, mean, factor, z))
    while True:
        if level == last:
            value = _normal_cdf(_bound(last, mean, factor, z))
        elif node[level] < _NODE.size:
            z[level] = upper[level] - 0.5 * width[level] * (1.0 - _NODE[node[level]])
            level += 1
            node[level], total[level] = 0, 0.0
            upper[level], width[level] = _stretch(_bound(level, mean, factor, z))
            continue
        else:
            value = 0.5 * width[level] * _INV_SQRT_2PI * total[level]
        if level == 0:
            return value
        level -= 1
        total[level] += _WEIGHT[node[level]] * math.exp(-0.5 * z[level] * z[level]) * value
        node[level] += 1


@inner()
def _latent_mean(event, response, data, mean):  # type: ignore[no-untyped-def]
    """Mean of the latent readings at the sensors not reached, given the observed ones."""
    row = response[data.release_of_event[event]]
    for k in range(data.n_stopped[event]):
        mean[k] = row[data.stopped[event, k]]
        for j in range(row.size):
            mean[k] += data.regression[event, k, j] * (data.readings[event, j] - row[j])


@compiled()
def pooled_log_density(response, data):  # type: ignore[no-untyped-def]
    """Log density of each event's readings.

    Parameters
    ----------
    response : (n_releases, n_sensors) array, m/s or m
    data : PooledArrays

    Returns
    -------
    (n_events,) array
    """
    n_events, n_sensors = data.readings.shape
    density = data.constant.copy()
    mean = np.zeros(MAX_NOT_REACHED)
    for event in range(n_events):
        row = response[data.release_of_event[event]]
        for i in range(n_sensors):
            whitened = 0.0
            for j in range(n_sensors):
                whitened += data.whiten[event, i, j] * (data.readings[event, j] - row[j])
            density[event] -= 0.5 * whitened * whitened
        size = data.n_stopped[event]
        if size > 0:
            _latent_mean(event, response, data, mean)
            density[event] += math.log(_orthant(size, mean, data.conditional[event]))
    return density


@inner()
def _orthant_slopes(size, mean, covariance, slopes):  # type: ignore[no-untyped-def]
    """Derivatives of log P(x <= 0) by the mean: the density at x_j = 0 times the rest given that."""
    probability = _orthant(size, mean, covariance)
    for j in range(size):
        variance = covariance[j, j]
        density = math.exp(-0.5 * mean[j] * mean[j] / variance) * _INV_SQRT_2PI / math.sqrt(variance)
        rest = 1.0
        if size > 1:
            others = np.array([k for k in range(size) if k != j])
            conditional = np.empty((size - 1, size - 1))
            shifted = np.empty(size - 1)
            for a in range(size - 1):
                shifted[a] = mean[others[a]] - covariance[others[a], j] / variance * mean[j]
                for b in range(size - 1):
                    product = covariance[others[a], j] * covariance[j, others[b]]
                    conditional[a, b] = covariance[others[a], others[b]] - product / variance
            rest = _orthant(size - 1, shifted, conditional)
        slopes[j] = -density * rest / probability


@compiled()
def pooled_log_density_pullback(cotangent, response, data):  # type: ignore[no-untyped-def]
    """Cotangent of the response, (n_releases, n_sensors), from that of the densities, (n_events,)."""
    n_events, n_sensors = data.readings.shape
    pulled = np.zeros(response.shape)
    mean, slopes = np.zeros(MAX_NOT_REACHED), np.zeros(MAX_NOT_REACHED)
    for event in range(n_events):
        release = data.release_of_event[event]
        for i in range(n_sensors):
            whitened = 0.0
            for j in range(n_sensors):
                residual = data.readings[event, j] - response[release, j]
                whitened += data.whiten[event, i, j] * residual
            for j in range(n_sensors):
                pulled[release, j] += cotangent[event] * whitened * data.whiten[event, i, j]
        size = data.n_stopped[event]
        if size > 0:
            _latent_mean(event, response, data, mean)
            _orthant_slopes(size, mean, data.conditional[event], slopes)
            for k in range(size):
                slope = cotangent[event] * slopes[k]
                pulled[release, data.stopped[event, k]] += slope
                for j in range(n_sensors):
                    pulled[release, j] -= slope * data.regression[event, k, j]
    return pulled
