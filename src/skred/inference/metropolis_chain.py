"""A chain of Metropolis moves in numba: random walks and independent jumps by turns.

A walk gets anywhere. A jump to an independent draw from a Student t (Tierney, 1994, doi
10.1214/aos/1176325750) forgets at once where the posterior is nearly normal in the coordinates it is made
in. These are the variables as PyMC has them, positive ones as logarithms, or by turns also some of those
themselves: a posterior can be nearly normal in one and a hook in the other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import types

from skred.parallel.compile_cache import compiled, inner

DEGREES_OF_FREEDOM = 6.0
"""Degrees of freedom of the jumps. Their tails must be heavier than the posterior's, or chains get stuck."""


@inner()
def _weighted_sum(rest, pointwise, weights):  # type: ignore[no-untyped-def]
    """Log density of the model with every pointwise term weighted; NaN becomes -inf."""
    total = rest.item()
    for i in range(weights.size):
        if weights[i] != 0.0:
            total += weights[i] * pointwise[i]
    return -np.inf if np.isnan(total) else total


@inner()
def _log_t(z):  # type: ignore[no-untyped-def]
    """Log density of a multivariate Student t at standardised z, but for its constant."""
    square = 0.0
    for i in range(z.size):
        square += z[i] * z[i]
    return -0.5 * (DEGREES_OF_FREEDOM + z.size) * np.log1p(square / DEGREES_OF_FREEDOM)


@inner()
def _standardise(x, mean, factor, z):  # type: ignore[no-untyped-def]
    """Solve x = mean + factor z."""
    for i in range(x.size):
        z[i] = x[i] - mean[i]
        for j in range(i):
            z[i] -= factor[i, j] * z[j]
        z[i] /= factor[i, i]


@inner()
def _add_product(start, factor, z, result):  # type: ignore[no-untyped-def]
    """Write start + factor z to `result`."""
    for i in range(z.size):
        result[i] = start[i]
        for j in range(i + 1):
            result[i] += factor[i, j] * z[j]


@inner()
def _exponentials(values, which, result):  # type: ignore[no-untyped-def]
    """Write the values to `result`, some of them as their exponentials."""
    for i in range(values.size):
        result[i] = np.exp(values[i]) if which[i] else values[i]


@inner()
def _logarithms(values, which):  # type: ignore[no-untyped-def]
    """Turn some of the values into their logarithms; False where one has none."""
    for i in range(values.size):
        if which[i]:
            if values[i] <= 0.0:
                return False
            values[i] = np.log(values[i])
    return True


def _run_chain(  # type: ignore[no-untyped-def]
    density, data, weights, moved, q, mean, factor, scale, noise, log_uniforms, draws, terms, acceptance
):
    """Metropolis moves, (n_draws, n_moves) of them, two by two in each coordinates: a walk and a jump.

    `q` is left at the last state; the state after each n_moves is stored in `draws`, and the
    pointwise terms there in `terms` unless that is empty. The mean probability that walks are accepted is
    stored in `acceptance`. Returns the share of all moves that was accepted.
    """
    # Plain arrays, some of which it fills: it is compiled for a signature.
    n_draws, n_moves, n = noise.shape
    n_coordinates = len(mean)
    accepted, n_walks = 0, np.zeros(n_coordinates)
    here, proposal, z = np.empty(n), np.empty(n), np.empty(n)
    walks = np.empty_like(factor)
    for way in range(n_coordinates):
        walks[way] = scale[way] * factor[way]
    rest, pointwise = density((q, *data))
    current = _weighted_sum(rest, pointwise, weights)
    for draw in range(n_draws):
        for move in range(n_moves):
            is_walk, way = move % 2 == 0, move // 2 % n_coordinates
            if way == 0:
                here[:] = q
            else:
                _exponentials(q, moved, here)
            correction = 0.0
            if is_walk:
                _add_product(here, walks[way], noise[draw, move], proposal)
                n_walks[way] += 1.0
            else:
                _add_product(mean[way], factor[way], noise[draw, move], proposal)
                _standardise(here, mean[way], factor[way], z)
                correction = _log_t(z) - _log_t(noise[draw, move])
            if way > 0:
                if not _logarithms(proposal, moved):
                    continue
                for i in range(n):
                    if moved[i]:  # the density of the variable itself is that of its logarithm over it
                        correction -= proposal[i] - q[i]
            rest, pointwise = density((proposal, *data))
            proposed = _weighted_sum(rest, pointwise, weights)
            # Both -inf: accept, so that a chain can leave a place of no density.
            difference = proposed - current + correction if proposed > -np.inf or current > -np.inf else 0.0
            if is_walk:
                acceptance[way] += np.exp(min(difference, 0.0))
            if log_uniforms[draw, move] < difference:
                for i in range(n):
                    q[i] = proposal[i]
                current = proposed
                accepted += 1
        for i in range(n):
            draws[draw, i] = q[i]
        if terms.size > 0:
            _, pointwise = density((q, *data))
            for i in range(pointwise.size):
                terms[draw, i] = pointwise[i]
    acceptance /= n_walks
    return accepted / (n_draws * n_moves)


@cache
def chain_for(density: types.FunctionType, data: types.BaseTuple) -> Callable[..., float]:
    """`_run_chain` for densities of a signature, which it calls through a pointer.

    Given the density itself numba would compile chain and kernel into one, 5 to 10 s for each model
    and no faster to run.
    """
    vector, matrix, cube = (types.Array(types.float64, n, "C") for n in (1, 2, 3))
    which = types.Array(types.boolean, 1, "C")
    signature = (
        density, data, vector, which, vector, matrix, cube, vector, cube, matrix, matrix, matrix, vector
    )  # fmt: skip
    chain: Callable[..., float] = compiled(signature)(_run_chain)
    return chain
