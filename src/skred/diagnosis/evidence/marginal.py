"""Evidence over the population, its events' strengths integrated already: by Laplace, by importance sampling.

A population is in the coordinates of `population_target`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode, Weighted, weighted_draws
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.population_target import (
    MOST_CORRELATED,
    NARROWEST,
    factor_at,
    log_targets,
    slopes,
)
from skred.diagnosis.evidence.tolerance import DRAWS, STANDARD_ERROR
from skred.inference.hierarchical.surface import Nodes

_LOG_2PI = math.log(2.0 * math.pi)
_RESAMPLED_FROM = 4
"""Draws of a turn for each population that is kept: so many that resampling repeats few."""


def _allowed(psi: FloatArray, n: int) -> FloatArray:
    """The nearest coordinates whose spreads are not too narrow, nor correlations too close to one."""
    allowed = psi.copy()
    allowed[n : 2 * n] = np.maximum(psi[n : 2 * n], NARROWEST)
    most = math.atanh(MOST_CORRELATED)
    allowed[2 * n :] = np.clip(psi[2 * n :], -most, most)
    return allowed


def _climb(
    psi: FloatArray, n: int, log_scale: FloatArray, nodes: Nodes, n_steps: int
) -> tuple[FloatArray, float, FloatArray]:
    """Newton's method with halved steps: the top, its height, and minus the Hessian there."""
    psi = _allowed(psi, n)
    best, gradient, hessian = slopes(psi, n, log_scale, *nodes)
    for _ in range(n_steps):
        values, axes = np.linalg.eigh(hessian)
        step = axes @ (axes.T @ gradient / np.maximum(np.abs(values), 0.5))
        step /= max(np.abs(step).max(), 1.0)
        gained, there = -1.0, psi
        for _ in range(8):
            there = _allowed(psi + step, n)
            gained = log_targets(there[None], n, log_scale, *nodes)[0] - best
            if gained >= -1e-9:
                break
            step = 0.4 * (there - psi)
        if gained < -1e-9:
            break
        psi = there
        best, gradient, hessian = slopes(psi, n, log_scale, *nodes)
        if gained < 1e-3:
            break
    return psi, best, hessian


class Evidence(NamedTuple):
    """What the population makes of nodes.

    Attributes
    ----------
    log_evidence : float
        By Laplace's formula, or by importance sampling.
    psi : (n_psi,) array
        Most probable population, in the coordinates of `population_target`; their mean where sampled.
    covariance : (n_psi, n_psi) array
    error : float
        Standard error by importance sampling, in nats; 0 where nothing was sampled.
    """

    log_evidence: float
    psi: FloatArray
    covariance: FloatArray
    error: float = 0.0


def population_at(psi: FloatArray, n: int) -> Population:
    """Populations of `n` strengths at coordinates, (n_groups, n_coordinates)."""
    factors = np.array([factor_at(one, n) for one in psi])
    return Population(psi[:, :n].copy(), np.einsum("gij,gkj->gik", factors, factors))


def wide_populations(found: Sequence[Evidence], n: int) -> Population:
    """Populations of `n` strengths as wide as what is known of them: they differ in mean and in spread.

    No wider than by a standard deviation of 0.7 of a log spread and of 1 of a mean.
    """
    population = population_at(np.stack([one.psi for one in found]), n)
    covariances = np.stack([one.covariance for one in found])
    wider = np.exp(np.minimum(np.sqrt(np.einsum("tii->ti", covariances)[:, n : 2 * n]), 0.7))
    wide = population.covariance * wider[:, :, None] * wider[:, None, :]
    return Population(population.mean, wide + _at_most_one(covariances[:, :n, :n]))


def _at_most_one(covariances: FloatArray) -> FloatArray:
    """Covariances of logarithms whose standard deviations are 1 at most, correlations as they are."""
    least = 1.0 / np.maximum(np.sqrt(np.einsum("tii->ti", covariances)), 1.0)
    return covariances * least[:, :, None] * least[:, None, :]


def coordinates(population: Population) -> FloatArray:
    """A population, of one group, in the coordinates of `population_target`."""
    covariance = population.covariance[0]
    n = len(covariance)
    spread = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance)
    partial = []
    for j in range(n):
        for i in range(j + 1, n):
            left = math.sqrt(max(covariance[i, i] - float(np.sum(factor[i, :j] ** 2)), 1e-12))
            partial.append(math.atanh(float(np.clip(factor[i, j] / left, -MOST_CORRELATED, MOST_CORRELATED))))
    return np.concatenate([population.mean[0], np.log(spread), partial])


def evidence(nodes: Nodes, log_scale: FloatArray, start: FloatArray, n_steps: int = 12) -> Evidence:
    """Evidence of nodes over the population, by Laplace's formula.

    Parameters
    ----------
    log_scale : (n_base,) array
        Logarithm of the scales of the medians' half-normal priors.
    start : (n_psi,) array
    """
    n = len(log_scale)
    psi, best, hessian = _climb(start, n, log_scale, nodes, n_steps)
    values, covariance = curvatures(hessian)
    laplace = best + 0.5 * (len(psi) * _LOG_2PI - float(np.log(values).sum()))
    return Evidence(laplace, psi, covariance)


def curvatures(hessian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Curvatures of minus a log density along its own axes, and the covariance that they stand for.

    Along no axis less than what keeps proposals bounded.
    """
    values, axes = np.linalg.eigh(hessian)
    values = np.maximum(values, 0.05)
    return values, (axes / values) @ axes.T


def importance_evidence(nodes: Nodes, log_scale: FloatArray, found: Evidence, seed: int = 0) -> Evidence:
    """Evidence by importance sampling from the Laplace approximation on, with the populations' moments."""
    weighted = _weighted(nodes, log_scale, found, np.random.default_rng([seed, 11]), DRAWS, STANDARD_ERROR)
    return Evidence(weighted.log_integral, *weighted.moments, weighted.error)


def importance_draws(
    nodes: Nodes, log_scale: FloatArray, found: Evidence, n: int, rng: np.random.Generator
) -> FloatArray:
    """Draws of the population, (n, n_psi): the Laplace approximation's, many more, weighted and resampled."""
    return _weighted(nodes, log_scale, found, rng, _RESAMPLED_FROM * n, np.inf).resampled(n, rng)


def _weighted(
    nodes: Nodes,
    log_scale: FloatArray,
    found: Evidence,
    rng: np.random.Generator,
    n_draws: int,
    enough: float,
) -> Weighted:
    """Draws of the population, weighted."""

    def log_density(psi: FloatArray) -> FloatArray:
        return log_targets(psi, len(log_scale), log_scale, *nodes)

    proposal = Mixture.on([Mode(found.psi, found.covariance)])
    return weighted_draws(log_density, proposal, rng, n_draws, enough)
