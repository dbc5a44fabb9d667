"""Log likelihoods of many populations, each event a sum over its nodes; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.parallel.compile_cache import compiled, inner

FloatArray = NDArray[np.float64]
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)
_NIL = 34.0
"""Nats below an event's largest term from which on a term is nil."""


class EventNodes(NamedTuple):
    """Brute-force nodes of all events over their own log coefficients; releases are summed over.

    Attributes
    ----------
    first : (n_events + 1,) integer array
        Where each event's nodes begin.
    points : (n, n_nodes) array
    log_weights : (n_nodes,) array
        Log likelihood plus the log of the volume that a node stands for.
    """

    first: NDArray[np.int64]
    points: FloatArray
    log_weights: FloatArray


@inner(fastmath=True)
def _exponents_1(at, shift, scale, log_weights, room):  # type: ignore[no-untyped-def]
    for k in range(room.size):
        x = (at[k] - shift) * scale
        room[k] = log_weights[k] - 0.5 * x * x


@inner(fastmath=True)
def _exponents_2(at_0, at_1, mean, factor, log_weights, room):  # type: ignore[no-untyped-def]
    a, b, c = 1.0 / factor[0, 0], 1.0 / factor[1, 1], factor[1, 0]
    shift_0, shift_1 = mean[0], mean[1]
    for k in range(room.size):
        x = (at_0[k] - shift_0) * a
        y = (at_1[k] - shift_1 - c * x) * b
        room[k] = log_weights[k] - 0.5 * (x * x + y * y)


@inner()
def _exponents_many(points, mean, factor, log_weights, room):  # type: ignore[no-untyped-def]
    z = np.empty(mean.size)
    for k in range(room.size):
        square = 0.0
        for i in range(mean.size):
            z[i] = points[i, k] - mean[i]
            for j in range(i):
                z[i] -= factor[i, j] * z[j]
            z[i] /= factor[i, i]
            square += z[i] * z[i]
        room[k] = log_weights[k] - 0.5 * square


@inner(fastmath=True)
def _log_sum(room):  # type: ignore[no-untyped-def]
    """Log of the sum of exponentials.

    That of x is (series of x / 256) to the power 256, right to 1e-6 at worst: the library's takes five times
    as long.
    """
    largest = room[0]
    for k in range(room.size):
        largest = max(largest, room[k])
    total = 0.0
    for k in range(room.size):
        x = max(room[k] - largest, -_NIL) * (1.0 / 256.0)
        y = 1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x / 720.0)))))
        y *= y
        y *= y
        y *= y
        y *= y
        y *= y
        y *= y
        y *= y
        y *= y
        total += y
    return largest + math.log(total)


@compiled()
def log_likelihoods_of(means, factors, first, points, log_weights):  # type: ignore[no-untyped-def]
    """Log likelihood of all events together for each population, (n_populations,).

    Parameters
    ----------
    means : (n_populations, n) array
    factors : (n_populations, n, n) array
        Lower Cholesky factors of the covariances.
    first, points, log_weights :
        As in `EventNodes`.
    """
    n_populations, n = means.shape
    n_events = first.size - 1
    most_nodes = 0
    for event in range(n_events):
        most_nodes = max(most_nodes, first[event + 1] - first[event])
    space = np.empty(most_nodes)
    result = np.zeros(n_populations)
    for one in range(n_populations):
        constant = -n * _LOG_SQRT_2PI
        for i in range(n):
            constant -= math.log(factors[one, i, i])
        mean, factor = means[one], factors[one]
        for event in range(n_events):
            start, end = first[event], first[event + 1]
            room, own = space[: end - start], log_weights[start:end]
            if n == 1:
                _exponents_1(points[0, start:end], mean[0], 1.0 / factor[0, 0], own, room)
            elif n == 2:
                _exponents_2(points[0, start:end], points[1, start:end], mean, factor, own, room)
            else:
                _exponents_many(points[:, start:end], mean, factor, own, room)
            result[one] += constant + _log_sum(room)
    return result
