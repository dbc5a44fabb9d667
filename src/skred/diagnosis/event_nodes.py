"""Importance nodes: each event's likelihood over its own strengths, where a population makes them likely.

A mixture of two proposals, most nodes around the event's own mode, some over the whole population, weighs
each node by the mixture's density; so a second mode (reached, not reached) that the first proposal misses
is still counted. The same quasi-random numbers serve every strength, which makes differences between
strengths smoother than the integrals themselves.
"""

from __future__ import annotations

import math
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from skred.diagnosis.extension import Extension
from skred.diagnosis.modes import Modes, Population, Rows
from skred.inference.reading_density import log_likelihoods
from skred.inference.surface import Nodes

FloatArray = NDArray[np.float64]
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)


class Budget(NamedTuple):
    """How many nodes an event gets, and how much wider than the linear model the proposals are.

    Attributes
    ----------
    linear : bool
        Take readings at the nodes from the tangents at the mode instead of from fronts: quick, and wrong
        where a front stops near a sensor.
    """

    around_mode: int = 64
    over_population: int = 32
    wider: float = 1.35
    population_wider: float = 1.6
    linear: bool = False


USUAL, FIRST, FINE = Budget(), Budget(32, 16), Budget(512, 256, 1.5, 1.8)
ROUGH = Budget(32, 16, linear=True)


@cache
def _normal_numbers(n_events: int, n: int, n_axes: int, seed: int) -> FloatArray:
    """Quasi-random standard normal numbers, (n_events, n, n_axes): of its own for each event.

    With the same for all events, what is left of the integration errors would add up in one direction.
    """
    uniforms = [
        qmc.Sobol(n_axes, scramble=True, rng=np.random.default_rng([seed, event])).random(n)
        for event in range(n_events)
    ]
    numbers: FloatArray = ndtri(np.clip(np.array(uniforms), 1e-12, 1.0 - 1e-12))
    return numbers


def event_nodes(
    extension: Extension,
    rows: Rows,
    strengths: FloatArray,
    population: Population,
    modes: Modes,
    budget: Budget = USUAL,
    reference: Population | None = None,
    shifts: FloatArray | None = None,
) -> Nodes:
    """Nodes of all rows, as the compiled sums over a population read them.

    Parameters
    ----------
    strengths : (n_directions,) or (n_rows, n_directions) array
        Of what is added.
    population : Population
        Roughly where the events' strengths are.
    modes : Modes
        Around which most nodes are put.
    reference : Population, optional
        Of one group: another population that the nodes must cover, half of those over the population are
        put there. Without it a population that has become too narrow would never see what it misses.
    shifts : (n_rows, n_base + 1) array, optional
        By which each row's quasi-random numbers are moved round along each axis, 0 to 1. For means over
        rows, not differences: what is left of the integration errors then averages out.
    """
    n_rows, n = len(rows.event), population.mean.shape[1]
    uncertain = extension.problem.releases.sd[rows.event] > 0.0
    axes = n + 1 if uncertain.any() else n
    cover = np.linalg.inv(modes.information + population.precision[rows.group])[:, :axes, :axes]
    around = budget.wider * np.linalg.cholesky(0.5 * (cover + cover.transpose(0, 2, 1)))
    both = [population] if reference is None else [population, reference]
    sizes = [budget.around_mode, *[budget.over_population // len(both)] * len(both)]
    centres, factors = [modes.points[:, :axes]], [around]
    for one in both:
        centre, over = _over(one, rows, axes, budget.population_wider)
        centres.append(centre)
        factors.append(over)
    numbers = partial(_normal_numbers, extension.problem.campaign.n_events)
    points = np.concatenate(
        [
            centre[:, None, :]
            + np.einsum("rij,rkj->rki", factor, _rotated(numbers(size, axes, k)[rows.event], shifts))
            for k, (centre, factor, size) in enumerate(zip(centres, factors, sizes, strict=True))
        ],
        axis=1,
    )
    log_proposal = np.full(points.shape[:2], -np.inf)
    for centre, factor, size in zip(centres, factors, sizes, strict=True):
        part = math.log(size / points.shape[1]) + _log_normal(points, centre, factor)
        log_proposal = np.logaddexp(log_proposal, part)
    n_nodes = points.shape[1]
    flat = np.zeros((n_rows * n_nodes, n + 1))
    flat[:, :axes] = points.reshape(-1, axes)
    which = np.repeat(np.arange(n_rows), n_nodes)
    if budget.linear:
        predictions = _linear_predictions(modes, flat, which)
    else:
        given = np.broadcast_to(strengths, (n_rows, len(extension.directions)))
        predictions = extension.predict(rows.event[which], flat, given[which])
    log_weights = log_likelihoods(which, predictions, rows.readings, rows.errors)
    if axes > n:
        log_weights = log_weights - 0.5 * flat[:, n] ** 2 - _LOG_SQRT_2PI
    log_weights = log_weights - log_proposal.ravel() - math.log(n_nodes)
    return Nodes(n_nodes * np.arange(n_rows + 1), np.ascontiguousarray(flat[:, :n].T), log_weights)


def _rotated(numbers: FloatArray, shifts: FloatArray | None) -> FloatArray:
    """Normal numbers, (n_rows, n, n_axes), their quantiles moved round by each row's shifts."""
    if shifts is None:
        return numbers
    quantiles = (ndtr(numbers) + shifts[:, None, : numbers.shape[2]]) % 1.0
    rotated: FloatArray = ndtri(np.clip(quantiles, 1e-12, 1.0 - 1e-12))
    return rotated


def _linear_predictions(modes: Modes, points: FloatArray, which: NDArray[np.int64]) -> FloatArray:
    """Readings along the tangents at each row's mode; a speed below zero is none."""
    change = np.einsum("pij,pj->pi", modes.by_points[which], points - modes.tangents_at[which])
    result: FloatArray = np.maximum(modes.predictions[which] + change, 0.0)
    return result


def _over(population: Population, rows: Rows, axes: int, wider: float) -> tuple[FloatArray, FloatArray]:
    """Centre and factor of a proposal over a whole population, for each row."""
    n = population.mean.shape[1]
    group = rows.group if len(population.mean) > 1 else np.zeros_like(rows.group)
    centre, factor = np.zeros((len(group), axes)), np.zeros((len(group), axes, axes))
    centre[:, :n] = population.mean[group]
    factor[:, :n, :n] = wider * np.linalg.cholesky(population.covariance)[group]
    if axes > n:
        factor[:, n, n] = 1.0
    return centre, factor


def _log_normal(points: FloatArray, mean: FloatArray, factor: FloatArray) -> FloatArray:
    """Log density of normal distributions, one a row: (n_rows, k, n_axes) points to (n_rows, k)."""
    white = np.einsum("rij,rkj->rki", np.linalg.inv(factor), points - mean[:, None, :])
    log_determinant = np.log(np.einsum("rii->ri", factor)).sum(axis=1)
    result: FloatArray = (
        -0.5 * np.sum(white**2, axis=2) - log_determinant[:, None] - points.shape[2] * _LOG_SQRT_2PI
    )
    return result
