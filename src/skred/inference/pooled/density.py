"""The pooled log density in numba: one value for each event; missing readings drop out, the rest is censored.

For every event the observed readings are whitened by the Cholesky factor of their own block of
Sigma. Sensors it did not reach add the probability that their latent readings, given the observed
ones, are all at most 0; readings known by bounds only, that they lie within these.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import roots_legendre

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.inference.bounds import log_density, log_inside
from skred.parallel.compile_cache import compiled, inner

MAX_NOT_REACHED = 4
"""Censored readings that an event may have; each beyond the first multiplies the work by the nodes."""

_NODE, _WEIGHT = (np.ascontiguousarray(a) for a in roots_legendre(24))
"""Gauss-Legendre quadrature over a sensor that was not reached, 24 points."""
_LEAST = 1e-280
"""Probability of several censored readings below which they are taken one by one."""
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
        How many readings of the event are censored.
    stopped : (n_events, MAX_NOT_REACHED) integer array
        Which ones.
    regression : (n_events, MAX_NOT_REACHED, n_sensors) array
        Of their latent readings on the residuals of the observed ones.
    conditional : (n_events, MAX_NOT_REACHED, MAX_NOT_REACHED) array
        Their covariance given the observed ones.
    sign, cut, width : (n_events, MAX_NOT_REACHED) arrays
        A latent reading x is known to have -width <= sign (x - cut) <= 0; regression and conditional are of
        sign x.
    """

    release_of_event: IntArray
    readings: FloatArray
    whiten: FloatArray
    constant: FloatArray
    n_stopped: IntArray
    stopped: IntArray
    regression: FloatArray
    conditional: FloatArray
    sign: FloatArray
    cut: FloatArray
    width: FloatArray


def pooled_arrays(
    values: FloatArray,
    observed: BoolArray,
    not_reached: BoolArray,
    release_of_event: IntArray,
    covariance: FloatArray,
    least: FloatArray | None = None,
    most: FloatArray | None = None,
) -> PooledArrays:
    """Arrays of the density for one pattern of gaps.

    Parameters
    ----------
    values, observed, not_reached, release_of_event, covariance
        As in `PooledProblem`.
    least, most : (n_events, n_sensors) arrays, optional
        Bounds of the readings that are known by these only; minus and plus infinity elsewhere.

    Raises
    ------
    ValueError
        If more than `MAX_NOT_REACHED` readings of an event are censored.
    """
    n_events, n_sensors = values.shape
    whiten = np.zeros((n_events, n_sensors, n_sensors))
    constant = np.zeros(n_events)
    stopped = np.zeros((n_events, MAX_NOT_REACHED), dtype=np.int64)
    regression = np.zeros((n_events, MAX_NOT_REACHED, n_sensors))
    conditional = np.zeros((n_events, MAX_NOT_REACHED, MAX_NOT_REACHED))
    sign, cut = np.ones((n_events, MAX_NOT_REACHED)), np.zeros((n_events, MAX_NOT_REACHED))
    width = np.full((n_events, MAX_NOT_REACHED), np.inf)
    least = np.full(values.shape, -np.inf) if least is None else least
    most = np.where(not_reached, 0.0, np.inf if most is None else most)
    censored = np.isfinite(least) | np.isfinite(most)
    n_stopped = censored.sum(axis=1).astype(np.int64)
    if n_stopped.max(initial=0) > MAX_NOT_REACHED:
        raise ValueError(
            f"event number {int(n_stopped.argmax()) + 1} did not reach {n_stopped.max()} sensors, or is known"
            f" by bounds there; the pooled likelihood takes up to {MAX_NOT_REACHED}: leave out some of them"
        )
    for event in range(n_events):
        seen, missed = np.flatnonzero(observed[event]), np.flatnonzero(censored[event])
        own = np.linalg.cholesky(covariance[np.ix_(seen, seen)])
        inverse = np.linalg.inv(own)
        whiten[event][np.ix_(np.arange(len(seen)), seen)] = inverse
        constant[event] = -np.log(np.diag(own)).sum() - 0.5 * len(seen) * np.log(2.0 * np.pi)
        n = len(missed)
        upper = np.isfinite(most[event, missed])
        sign[event, :n] = np.where(upper, 1.0, -1.0)
        cut[event, :n] = np.where(upper, most[event, missed], least[event, missed])
        width[event, :n] = np.where(upper, most[event, missed] - least[event, missed], np.inf)
        across = inverse @ covariance[np.ix_(seen, missed)] * sign[event, :n]
        stopped[event, :n] = missed
        regression[event][np.ix_(np.arange(n), seen)] = across.T @ inverse
        signs = np.outer(sign[event, :n], sign[event, :n])
        conditional[event, :n, :n] = signs * covariance[np.ix_(missed, missed)] - across.T @ across
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
        sign,
        cut,
        width,
    )


@inner()
def _normal_between(low, high):  # type: ignore[no-untyped-def]
    """Probability of an interval, from the tail in which the difference does not cancel."""
    if low > 0.0:
        return 0.5 * (math.erfc(low * _SQRT_HALF) - math.erfc(high * _SQRT_HALF))
    return 0.5 * (math.erfc(-high * _SQRT_HALF) - math.erfc(-low * _SQRT_HALF))


@inner()
def _bound(level, mean, factor, z):  # type: ignore[no-untyped-def]
    """Largest z_level with x_level <= 0, given the z above it."""
    bound = -mean[level]
    for j in range(level):
        bound -= factor[level, j] * z[j]
    return bound / factor[level, level]


@inner()
def _stretch(low, bound):  # type: ignore[no-untyped-def]
    """Upper end and width of the stretch between two bounds that holds its probability to e^-36."""
    if low > 0.0:
        upper = min(bound, math.sqrt(low * low + 72.0))
        return upper, upper - low
    upper = min(bound, 8.5)
    width = upper + 8.5 if upper > 0.0 else upper + math.sqrt(upper * upper + 72.0)
    return upper, min(width, upper - low)


@inner()
def _tightest_first(size, mean, width, covariance):  # type: ignore[no-untyped-def]
    """Mean, width and Cholesky factor with the largest mean in standard deviations first.

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
    ordered, wide, factor = np.empty(size), np.empty(size), np.zeros((size, size))
    for i in range(size):
        ordered[i], wide[i] = mean[left[i]], width[left[i]]
        for j in range(i + 1):
            rest = covariance[left[i], left[j]]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(rest) if i == j else rest / factor[j, j]
    return ordered, wide, factor


@inner()
def _orthant(size, unordered, widths, covariance):  # type: ignore[no-untyped-def]
    """P(-widths[k] <= x_k <= 0 for all k) for x ~ N(unordered, covariance).

    Nested Gauss-Legendre over all z but the last, each on the stretch that holds the probability,
    so that it works in the far tail as well. A loop over levels: numba cannot cache a recursion.
    """
    mean, wide, factor = _tightest_first(size, unordered, widths, covariance)
    last = size - 1
    z, upper, width = np.zeros(size), np.zeros(size), np.zeros(size)
    total, node = np.zeros(size), np.zeros(size, dtype=np.int64)
    level = 0
    bound = _bound(0, mean, factor, z)
    upper[0], width[0] = _stretch(bound - wide[0] / factor[0, 0], bound)
    while True:
        if level == last:
            bound = _bound(last, mean, factor, z)
            value = _normal_between(bound - wide[last] / factor[last, last], bound)
        elif node[level] < _NODE.size:
            z[level] = upper[level] - 0.5 * width[level] * (1.0 - _NODE[node[level]])
            level += 1
            node[level], total[level] = 0, 0.0
            bound = _bound(level, mean, factor, z)
            upper[level], width[level] = _stretch(bound - wide[level] / factor[level, level], bound)
            continue
        else:
            value = 0.5 * width[level] * _INV_SQRT_2PI * total[level]
        if level == 0:
            return value
        level -= 1
        total[level] += _WEIGHT[node[level]] * math.exp(-0.5 * z[level] * z[level]) * value
        node[level] += 1


@inner()
def _log_orthant(size, mean, width, covariance):  # type: ignore[no-untyped-def]
    """Log of `_orthant`; where that is below any number, of the variables one by one."""
    if size > 1:
        probability = _orthant(size, mean, width, covariance)
        if probability > _LEAST:
            return math.log(probability)
    total = 0.0
    for k in range(size):
        sd = math.sqrt(covariance[k, k])
        total += log_inside((-width[k] - mean[k]) / sd, -mean[k] / sd, False)
    return total


@inner()
def _latent_mean(event, response, data, mean):  # type: ignore[no-untyped-def]
    """Mean of the latent readings that are censored, given the observed ones: of sign (x - cut)."""
    row = response[data.release_of_event[event]]
    for k in range(data.n_stopped[event]):
        mean[k] = data.sign[event, k] * (row[data.stopped[event, k]] - data.cut[event, k])
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
            density[event] += _log_orthant(size, mean, data.width[event], data.conditional[event])
    return density


@inner()
def _rest(size, mean, width, covariance, j, end):  # type: ignore[no-untyped-def]
    """Probability of all but one of the conditions of `_orthant`, given that x_j lies at `end`."""
    others = np.array([k for k in range(size) if k != j])
    conditional = np.empty((size - 1, size - 1))
    shifted, wide = np.empty(size - 1), np.empty(size - 1)
    for a in range(size - 1):
        wide[a] = width[others[a]]
        by_x = covariance[others[a], j] / covariance[j, j]
        shifted[a] = mean[others[a]] + by_x * (end - mean[j])
        for b in range(size - 1):
            conditional[a, b] = covariance[others[a], others[b]] - by_x * covariance[j, others[b]]
    return _orthant(size - 1, shifted, wide, conditional)


@inner()
def _orthant_slopes(size, mean, width, covariance, slopes):  # type: ignore[no-untyped-def]
    """Derivatives of the log probability by the mean: density at either end of x_j times the rest there."""
    log_probability = _log_orthant(size, mean, width, covariance)
    alone = size == 1 or log_probability < math.log(_LEAST)
    for j in range(size):
        slopes[j], sd = 0.0, math.sqrt(covariance[j, j])
        if alone:
            log_probability = log_inside((-width[j] - mean[j]) / sd, -mean[j] / sd, False)
        for end, sign in ((0.0, -1.0), (-width[j], 1.0)):
            if abs(end) == np.inf:
                continue
            hazard = math.exp(log_density((end - mean[j]) / sd, False) - log_probability) / sd
            rest = 1.0 if alone else _rest(size, mean, width, covariance, j, end)
            slopes[j] += sign * hazard * rest


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
            _orthant_slopes(size, mean, data.width[event], data.conditional[event], slopes)
            for k in range(size):
                slope = cotangent[event] * slopes[k]
                pulled[release, data.stopped[event, k]] += slope * data.sign[event, k]
                for j in range(n_sensors):
                    pulled[release, j] -= slope * data.regression[event, k, j]
    return pulled
