"""Density of one event over a population, in numba: sums over the nodes of its surface, draws from them."""

from __future__ import annotations

import math

import numpy as np

from skred.parallel.compile_cache import compiled, inner

_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)
_NEGLIGIBLE = -60.0
"""Log share of the largest term below which a term is nil in double precision."""


@inner()
def inverse_factor(factor):  # type: ignore[no-untyped-def]
    """Inverse of a lower triangular matrix, and the log of its determinant."""
    n = factor.shape[0]
    inverse, log_determinant = np.zeros((n, n)), 0.0
    for i in range(n):
        inverse[i, i] = 1.0 / factor[i, i]
        log_determinant += math.log(inverse[i, i])
        for j in range(i):
            for k in range(j, i):
                inverse[i, j] -= factor[i, k] * inverse[k, j]
            inverse[i, j] *= inverse[i, i]
    return inverse, log_determinant


@inner(fastmath={"contract", "reassoc", "nsz", "arcp"})
def _of_one(at, shift, scale, log_weights, result):  # type: ignore[no-untyped-def]
    """`_exponents` of one strength; nodes as slices, or the compiler makes no vectors of them."""
    for k in range(result.size):
        z = scale * (at[k] - shift)
        result[k] = log_weights[k] - 0.5 * z * z


@inner(fastmath={"contract", "reassoc", "nsz", "arcp"})
def _of_two(at_0, at_1, mean, whiten, log_weights, result):  # type: ignore[no-untyped-def]
    """`_exponents` of two strengths."""
    shift_0, shift_1, a, b, c = mean[0], mean[1], whiten[0, 0], whiten[1, 0], whiten[1, 1]
    for k in range(result.size):
        x, y = at_0[k] - shift_0, at_1[k] - shift_1
        z_0, z_1 = a * x, b * x + c * y
        result[k] = log_weights[k] - 0.5 * z_0 * z_0 - 0.5 * z_1 * z_1


@inner()
def _largest(values):  # type: ignore[no-untyped-def]
    """The largest value; in four runs, because each comparison waits for the one before."""
    a = b = c = d = -np.inf
    whole = values.size // 4
    for k in range(whole):
        a, b = max(a, values[4 * k]), max(b, values[4 * k + 1])
        c, d = max(c, values[4 * k + 2]), max(d, values[4 * k + 3])
    for k in range(4 * whole, values.size):
        a = max(a, values[k])
    return max(max(a, b), max(c, d))


@inner()
def _exponents(first, last, mean, whiten, points, log_weights, room):  # type: ignore[no-untyped-def]
    """Log weight times normal density, but for its constant, at nodes first to last; returns the largest."""
    n_strengths, result = mean.size, room[: last - first]
    if n_strengths == 1:
        _of_one(points[0, first:last], mean[0], whiten[0, 0], log_weights[first:last], result)
    elif n_strengths == 2:
        _of_two(points[0, first:last], points[1, first:last], mean, whiten, log_weights[first:last], result)
    else:
        for k in range(last - first):
            result[k] = log_weights[first + k]
            for i in range(n_strengths):
                z = 0.0
                for j in range(i + 1):
                    z += whiten[i, j] * (points[j, first + k] - mean[j])
                result[k] -= 0.5 * z * z
    return _largest(result)


@inner(fastmath={"contract", "reassoc", "nsz", "arcp"})
def _sum_of_exponentials(exponents, size, largest):  # type: ignore[no-untyped-def]
    """Sum of exp(exponent - largest): exp(x / 1024) by its series, squared ten times, which vectorises.

    Its relative error is about 1e-13; what is negligible counts as e^-60.
    """
    total = 0.0
    for k in range(size):
        x = max(exponents[k] - largest, _NEGLIGIBLE) * (1.0 / 1024.0)
        power = 1.0 + x * (
            1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x / 720.0))))
        )
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        power *= power
        total += power
    return total


@inner()
def log_sum(first, last, mean, whiten, points, log_weights, room):  # type: ignore[no-untyped-def]
    """Log of the sum over nodes first to last, but for the normal density's constant."""
    largest = _exponents(first, last, mean, whiten, points, log_weights, room)
    return largest + math.log(_sum_of_exponentials(room, last - first, largest))


@compiled()
def integrated_log_density(  # type: ignore[no-untyped-def]
    means, factor, first, points, log_weights, log_widths
):
    """Log likelihood of each event, its own strengths integrated over the population.

    A population narrower than the distance between nodes has more than all of itself at one of them, or less:
    where it has more, the likelihood is its mean over the nodes, of which no more than all count.

    Parameters
    ----------
    means : (n_events, n_strengths) array
        Population mean of the logarithms of the strengths, for each event.
    factor : (n_strengths, n_strengths) array
        Lower Cholesky factor of their covariance.
    first : (n_events + 1,) integer array
        Where each event's nodes begin.
    points : (n_strengths, n_nodes) array
    log_weights : (n_nodes,) array
    log_widths : (n_nodes,) or (0,) array
        As in `surface.Nodes`.

    Returns
    -------
    (n_events,) array
    """
    n_events, n_strengths = means.shape
    whiten, log_determinant = inverse_factor(factor)
    constant = log_determinant - n_strengths * _LOG_SQRT_2PI
    exponents = np.empty(np.max(first[1:] - first[:-1]))
    density = np.empty(n_events)
    for event in range(n_events):
        start, end = first[event], first[event + 1]
        mean = means[event]
        density[event] = constant + log_sum(start, end, mean, whiten, points, log_weights, exponents)
        if log_widths.size > 0:
            there = constant + log_sum(start, end, mean, whiten, points, log_widths, exponents)
            density[event] -= max(there, 0.0)
    return density


@inner()
def _pull(cotangent, first, last, mean, whiten, points, log_weights, room, by_mean, by_factor):  # type: ignore[no-untyped-def]
    """Add an event's cotangents of its mean, (n,), and of the factor, (n, n); but for the constant's."""
    n = mean.size
    z, back, total = np.empty(n), np.empty(n), 0.0
    largest = _exponents(first, last, mean, whiten, points, log_weights, room)
    for k in range(last - first):
        room[k] = math.exp(room[k] - largest)
        total += room[k]
    for k in range(last - first):
        weight = cotangent * room[k] / total
        if weight == 0.0:
            continue
        for i in range(n):
            z[i] = 0.0
            for j in range(i + 1):
                z[i] += whiten[i, j] * (points[j, first + k] - mean[j])
        for j in range(n):
            back[j] = 0.0
            for i in range(j, n):
                back[j] += whiten[i, j] * z[i]
        for j in range(n):
            by_mean[j] += weight * back[j]
            for i in range(j, n):
                by_factor[i, j] += weight * back[i] * z[j]


@compiled()
def integrated_log_density_pullback(  # type: ignore[no-untyped-def]
    cotangent, means, factor, first, points, log_weights, log_widths
):
    """Cotangents of means and factor, one below the other, from those of the densities.

    Returns
    -------
    (n_events + n_strengths, n_strengths) array
    """
    n_events, n = means.shape
    whiten, log_determinant = inverse_factor(factor)
    constant = log_determinant - n * _LOG_SQRT_2PI
    room = np.empty(np.max(first[1:] - first[:-1]))
    pulled = np.zeros((n_events + n, n))
    for event in range(n_events):
        start, end, mean = first[event], first[event + 1], means[event]
        by_mean, by_factor, own = pulled[event], pulled[n_events:], cotangent[event]
        _pull(own, start, end, mean, whiten, points, log_weights, room, by_mean, by_factor)
        if log_widths.size > 0:
            there = constant + log_sum(start, end, mean, whiten, points, log_widths, room)
            if there > 0.0:
                _pull(-own, start, end, mean, whiten, points, log_widths, room, by_mean, by_factor)
                continue
        for j in range(n):
            by_factor[j, j] -= own * whiten[j, j]
    return pulled


@compiled()
def draw_nodes(means, factors, uniforms, first, points, log_weights):  # type: ignore[no-untyped-def]
    """A node of each event for each population, drawn by its share of the integral.

    Parameters
    ----------
    means : (n, n_strengths) array
    factors : (n, n_strengths, n_strengths) array
    uniforms : (n, n_events) array
    first, points, log_weights :
        As for `integrated_log_density`.

    Returns
    -------
    (n, n_events) integer array
    """
    n, n_events = uniforms.shape
    drawn = np.empty((n, n_events), dtype=np.int64)
    exponents = np.empty(np.max(first[1:] - first[:-1]))
    for draw in range(n):
        whiten, _ = inverse_factor(factors[draw])
        for event in range(n_events):
            start, size = first[event], first[event + 1] - first[event]
            largest = _exponents(start, start + size, means[draw], whiten, points, log_weights, exponents)
            total = 0.0
            for k in range(size):
                total += math.exp(exponents[k] - largest)
                exponents[k] = total
            node = np.searchsorted(exponents[:size], uniforms[draw, event] * total, side="right")
            drawn[draw, event] = start + min(node, size - 1)
    return drawn
