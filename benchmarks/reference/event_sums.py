"""Log likelihoods of many populations, each event a sum over its nodes; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.parallel.compile_cache import compiled

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
    room, z = np.empty(most_nodes), np.empty(n)
    result = np.zeros(n_populations)
    for one in range(n_populations):
        constant = -n * _LOG_SQRT_2PI
        for i in range(n):
            constant -= math.log(factors[one, i, i])
        for event in range(n_events):
            start, size = first[event], first[event + 1] - first[event]
            largest = -np.inf
            if n == 1:
                shift, scale = means[one, 0], 1.0 / factors[one, 0, 0]
                for k in range(size):
                    x = (points[0, start + k] - shift) * scale
                    room[k] = log_weights[start + k] - 0.5 * x * x
                    largest = max(largest, room[k])
            elif n == 2:
                a, b = 1.0 / factors[one, 0, 0], 1.0 / factors[one, 1, 1]
                c = factors[one, 1, 0]
                shift_0, shift_1 = means[one, 0], means[one, 1]
                for k in range(size):
                    x = (points[0, start + k] - shift_0) * a
                    y = (points[1, start + k] - shift_1 - c * x) * b
                    room[k] = log_weights[start + k] - 0.5 * (x * x + y * y)
                    largest = max(largest, room[k])
            else:
                for k in range(size):
                    square = 0.0
                    for i in range(n):
                        z[i] = points[i, start + k] - means[one, i]
                        for j in range(i):
                            z[i] -= factors[one, i, j] * z[j]
                        z[i] /= factors[one, i, i]
                        square += z[i] * z[i]
                    room[k] = log_weights[start + k] - 0.5 * square
                    largest = max(largest, room[k])
            total = 0.0
            for k in range(size):
                if room[k] > largest - _NIL:
                    total += math.exp(room[k] - largest)
            result[one] += constant + largest + math.log(total)
    return result
