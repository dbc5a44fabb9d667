"""Importance nodes: each event's likelihood over its own strengths, where a population makes them likely.

A mixture of two proposals, most nodes around the event's own mode, some over the whole population, weighs
each node by the mixture's density; so a second mode (reached, not reached) that the first proposal misses
is still counted. The same quasi-random numbers serve every event and every strength, which makes
differences between strengths smoother than the integrals themselves.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from skred.diagnosis.extension import Extension
from skred.diagnosis.modes import Modes, Population, Rows
from skred.inference.event_density import log_likelihoods
from skred.inference.surface import Nodes

FloatArray = NDArray[np.float64]
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)


class Budget(NamedTuple):
    """How many nodes an event gets, and how much wider than the linear model the proposals are."""

    around_mode: int = 64
    over_population: int = 16
    wider: float = 1.35
    population_wider: float = 1.6


USUAL, FIRST, FINE = Budget(), Budget(32, 16), Budget(256, 64, 1.5, 1.8)


@cache
def _normal_numbers(n: int, n_axes: int, seed: int) -> FloatArray:
    """Quasi-random standard normal numbers, (n, n_axes)."""
    uniforms = qmc.Sobol(n_axes, scramble=True, rng=np.random.default_rng(seed)).random(n)
    numbers: FloatArray = ndtri(np.clip(uniforms, 1e-12, 1.0 - 1e-12))
    return numbers


def event_nodes(
    extension: Extension,
    rows: Rows,
    strengths: FloatArray,
    population: Population,
    modes: Modes,
    budget: Budget = USUAL,
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
    """
    n_rows, n = len(rows.event), population.mean.shape[1]
    uncertain = extension.problem.releases.sd[rows.event] > 0.0
    axes = n + 1 if uncertain.any() else n
    cover = np.linalg.inv(modes.information + population.precision[rows.group])[:, :axes, :axes]
    around = budget.wider * np.linalg.cholesky(0.5 * (cover + cover.transpose(0, 2, 1)))
    over = np.zeros((n_rows, axes, axes))
    over[:, :n, :n] = budget.population_wider * np.linalg.cholesky(population.covariance)[rows.group]
    if axes > n:
        over[:, n, n] = 1.0
    centre = np.zeros((n_rows, axes))
    centre[:, :n] = population.mean[rows.group]
    first = _normal_numbers(budget.around_mode, axes, 0)
    second = _normal_numbers(budget.over_population, axes, 1)
    points = np.concatenate(
        [
            modes.points[:, None, :axes] + np.einsum("rij,kj->rki", around, first),
            centre[:, None, :] + np.einsum("rij,kj->rki", over, second),
        ],
        axis=1,
    )
    share = budget.around_mode / (budget.around_mode + budget.over_population)
    log_proposal = np.logaddexp(
        math.log(share) + _log_normal(points, modes.points[:, :axes], around),
        math.log(1.0 - share) + _log_normal(points, centre, over),
    )
    n_nodes = points.shape[1]
    flat = np.zeros((n_rows * n_nodes, n + 1))
    flat[:, :axes] = points.reshape(-1, axes)
    which = np.repeat(np.arange(n_rows), n_nodes)
    given = np.broadcast_to(strengths, (n_rows, len(extension.directions)))
    predictions = extension.predict(rows.event[which], flat, given[which])
    log_weights = log_likelihoods(which, predictions, rows.readings, rows.errors)
    if axes > n:
        log_weights = log_weights - 0.5 * flat[:, n] ** 2 - _LOG_SQRT_2PI
    log_weights = log_weights - log_proposal.ravel() - math.log(n_nodes)
    return Nodes(n_nodes * np.arange(n_rows + 1), np.ascontiguousarray(flat[:, :n].T), log_weights)


def _log_normal(points: FloatArray, mean: FloatArray, factor: FloatArray) -> FloatArray:
    """Log density of normal distributions, one a row: (n_rows, k, n_axes) points to (n_rows, k)."""
    white = np.einsum("rij,rkj->rki", np.linalg.inv(factor), points - mean[:, None, :])
    log_determinant = np.log(np.einsum("rii->ri", factor)).sum(axis=1)
    result: FloatArray = (
        -0.5 * np.sum(white**2, axis=2) - log_determinant[:, None] - points.shape[2] * _LOG_SQRT_2PI
    )
    return result
