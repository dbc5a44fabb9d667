"""The posterior density of the population, its events' strengths integrated already, and its slopes.

Coordinates of the population: means of the log strengths, logarithms of the spreads, inverse hyperbolic
tangents of the partial correlations. Compiled, because a diagnosis asks for it a thousand times.
"""

from __future__ import annotations

import math

import numpy as np

from skred.inference.hierarchical.event_density import integrated_log_density, inverse_factor, log_sum
from skred.inference.hierarchical.population import LKJ_SHAPE
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN
from skred.parallel.compile_cache import compiled, inner

_LOG_MEDIAN = math.log(SPREAD_MEDIAN)
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)
_NEGLIGIBLE = -25.0
"""Log share of an event's integral below which a node does not count for slopes."""
_STEP = 2e-3
"""Of the differences that a curvature is taken from, in the population's coordinates."""
NARROWEST = _LOG_MEDIAN - 6.0 * SPREAD_LOG_SD
"""Least log of a spread, six standard deviations of its prior below the median: 0.0036. Narrower populations
are between the nodes, whose sums then promise what is not there, tens of nats."""
MOST_CORRELATED = 0.99
"""Largest partial correlation that a climb goes to: beyond, a covariance has no inverse in these numbers."""


@compiled()
def factor_at(psi, n):  # type: ignore[no-untyped-def]
    """Lower Cholesky factor of the covariance; partial correlations as in `population.population_factor`."""
    factor = np.zeros((n, n))
    for i in range(n):
        left = math.exp(psi[n + i])
        for j in range(i):
            # Pairs in the order (0, 1), (0, 2), ..., (1, 2), ...
            r = math.tanh(psi[2 * n + j * n - j * (j + 1) // 2 + i - j - 1])
            factor[i, j] = left * r
            left *= math.sqrt(1.0 - r * r + 1e-12)
        factor[i, i] = left
    return factor


@inner()
def _means(psi, n, n_events):  # type: ignore[no-untyped-def]
    """The population's mean, the same for each event."""
    means = np.empty((n_events, n))
    for i in range(n):
        means[:, i] = psi[i]
    return means


@compiled()
def log_prior(psi, n, log_scale):  # type: ignore[no-untyped-def]
    """Log prior density in these coordinates; (1 + r) / 2 of a partial correlation r is a beta variable."""
    total = 0.0
    for i in range(n):
        # Half-normal median, in the logarithm.
        z = psi[i] - log_scale[i]
        total += 0.5 * math.log(2.0 / math.pi) - 0.5 * math.exp(2.0 * z) + z
        z = (psi[n + i] - _LOG_MEDIAN) / SPREAD_LOG_SD
        total += -0.5 * z * z - math.log(SPREAD_LOG_SD) - _HALF_LOG_2PI
    position = 2 * n
    for j in range(n):
        shape = LKJ_SHAPE + 0.5 * (n - 2 - j)
        constant = math.lgamma(2.0 * shape) - 2.0 * math.lgamma(shape) - (2.0 * shape - 1.0) * math.log(2.0)
        for _ in range(j + 1, n):
            r = math.tanh(psi[position])
            total += constant + shape * math.log(max(1.0 - r * r, 1e-300))
            position += 1
    return total


@inner()
def _log_target(psi, n, log_scale, first, points, log_weights, log_widths):  # type: ignore[no-untyped-def]
    for i in range(n):
        if psi[n + i] < NARROWEST:
            return -np.inf
    means = _means(psi, n, first.size - 1)
    density = integrated_log_density(means, factor_at(psi, n), first, points, log_weights, log_widths)
    total = log_prior(psi, n, log_scale) + density.sum()
    return total if total == total else -np.inf


@inner()
def _fill_statistics(point, mean, whiten, statistics):  # type: ignore[no-untyped-def]
    """Statistics of a normal density: whitened strengths, then their products (0, 0), (1, 0), (1, 1), ...

    Returns the exponent of the density.
    """
    n, exponent = mean.size, 0.0
    place = n
    for i in range(n):
        statistics[i] = 0.0
        for j in range(i + 1):
            statistics[i] += whiten[i, j] * (point[j] - mean[j])
        exponent -= 0.5 * statistics[i] ** 2
        for j in range(i + 1):
            statistics[place] = statistics[i] * statistics[j]
            place += 1
    return exponent


@inner()
def _add_moments(sign, first, last, at, whiten, points, log_weights, log_total, mean, covariance):  # type: ignore[no-untyped-def]
    """Add, or take away, mean and covariance of the statistics over an event's nodes, each by its share."""
    size = mean.size
    own, square, statistics = np.zeros(size), np.zeros((size, size)), np.empty(size)
    for k in range(first, last):
        exponent = _fill_statistics(points[:, k], at, whiten, statistics)
        log_share = log_weights[k] + exponent - log_total
        if log_share < _NEGLIGIBLE:
            continue
        for i in range(size):
            part = math.exp(log_share) * statistics[i]
            own[i] += part
            for j in range(size):
                square[i, j] += part * statistics[j]
    for i in range(size):
        mean[i] += sign * own[i]
        for j in range(size):
            covariance[i, j] += sign * (square[i, j] - own[i] * own[j])


@inner()
def _node_moments(psi, n, first, points, log_weights, log_widths):  # type: ignore[no-untyped-def]
    """Sums over events: of log integrals, and of means and covariances of the statistics over the nodes.

    As `integrated_log_density`: less those of the population itself, of events whose nodes have more than all
    of it. And the number of the others.
    """
    n_events, at = first.size - 1, psi[:n]
    whiten, log_determinant = inverse_factor(factor_at(psi, n))
    constant = log_determinant - n * _HALF_LOG_2PI
    size = n + n * (n + 1) // 2
    mean, covariance = np.zeros(size), np.zeros((size, size))
    room, total, n_whole = np.empty(np.max(first[1:] - first[:-1])), 0.0, 0
    for event in range(n_events):
        start, end = first[event], first[event + 1]
        log_l = log_sum(start, end, at, whiten, points, log_weights, room)
        _add_moments(1.0, start, end, at, whiten, points, log_weights, log_l, mean, covariance)
        there = -np.inf
        if log_widths.size > 0:
            there = log_sum(start, end, at, whiten, points, log_widths, room)
        if constant + there > 0.0:
            _add_moments(-1.0, start, end, at, whiten, points, log_widths, there, mean, covariance)
            total += log_l - there
        else:
            total += log_l + constant
            n_whole += 1
    return total, mean, covariance, n_whole


@inner()
def _dot(a, b):  # type: ignore[no-untyped-def]
    """Scalar product; written out, as are those below, because ``@`` takes seconds to compile."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@inner()
def _natural(psi, n, centre, whiten):  # type: ignore[no-untyped-def]
    """Natural parameters of a population in coordinates whitened about another, and its normalising term."""
    factor, between, offset = factor_at(psi, n), np.zeros((n, n)), np.zeros(n)
    for i in range(n):
        for k in range(i + 1):
            offset[i] += whiten[i, k] * (psi[k] - centre[k])
            for j in range(k + 1):
                between[i, j] += whiten[i, k] * factor[k, j]
    inverse, log_determinant = inverse_factor(between)
    found, place = np.zeros(n + n * (n + 1) // 2), n
    for i in range(n):
        for j in range(i + 1):
            precision = _dot(inverse[i:, i], inverse[i:, j])
            found[place] = -precision if j < i else -0.5 * precision
            found[i] += precision * offset[j]
            if j < i:
                found[j] += precision * offset[i]
            place += 1
    return found, 0.5 * _dot(offset, found[:n]) - log_determinant


@inner()
def _smooth(psi, n, log_scale, mean, n_events, centre, whiten):  # type: ignore[no-untyped-def]
    """What the log target is beside its log integrals, those along a tangent; and natural parameters."""
    parameters, normaliser = _natural(psi, n, centre, whiten)
    return _dot(mean, parameters) - n_events * normaliser + log_prior(psi, n, log_scale), parameters


@compiled()
def slopes(psi, n, log_scale, first, points, log_weights, log_widths):  # type: ignore[no-untyped-def]
    """Log target, its gradient and minus its Hessian, with one sum over the nodes.

    An event's log integral is the cumulant function of the statistics of `_node_moments` in the population's
    natural parameters: its derivatives by those are their means and covariances. What remains, the natural
    parameters by the coordinates, and the prior, is without nodes and differenced.
    """
    log_integrals, mean, covariance, n_whole = _node_moments(psi, n, first, points, log_weights, log_widths)
    centre, (whiten, _) = psi[:n].copy(), inverse_factor(factor_at(psi, n))
    size = psi.size
    value = log_integrals + log_prior(psi, n, log_scale)
    natural = np.empty((size, mean.size))
    gradient, hessian = np.empty(size), np.empty((size, size))
    fixed = n, log_scale, mean, n_whole, centre, whiten
    middle, _ = _smooth(psi, *fixed)
    sides, there = np.empty(size), psi.copy()
    for i in range(size):
        there[i] = psi[i] + _STEP
        high, up = _smooth(there, *fixed)
        there[i] = psi[i] - _STEP
        low, down = _smooth(there, *fixed)
        there[i] = psi[i]
        for k in range(mean.size):
            natural[i, k] = (up[k] - down[k]) / (2.0 * _STEP)
        gradient[i] = (high - low) / (2.0 * _STEP)
        sides[i] = high - 2.0 * middle + low
        hessian[i, i] = -sides[i] / _STEP**2
        for j in range(i):
            total = 0.0
            for side in (-_STEP, _STEP):
                there[i], there[j] = psi[i] + side, psi[j] + side
                total += _smooth(there, *fixed)[0]
            there[i], there[j] = psi[i], psi[j]
            both = total - 2.0 * middle
            hessian[i, j] = hessian[j, i] = -(both - sides[i] - sides[j]) / (2.0 * _STEP**2)
    for i in range(size):
        for k in range(mean.size):
            along = _dot(natural[i], covariance[:, k])
            for j in range(size):
                hessian[i, j] -= along * natural[j, k]
    return value, gradient, hessian


@compiled()
def log_targets(psis, n, log_scale, first, points, log_weights, log_widths):  # type: ignore[no-untyped-def]
    """Log posterior density of populations at coordinates (n_psis, size), as `log_prior` not normalised."""
    result = np.empty(len(psis))
    for k in range(len(psis)):
        result[k] = _log_target(psis[k], n, log_scale, first, points, log_weights, log_widths)
    return result
