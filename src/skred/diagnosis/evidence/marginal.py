"""Evidence over the population, its events' strengths integrated already: by Laplace, by importance sampling.

Coordinates of the population: means of the log strengths, logarithms of the spreads, inverse hyperbolic
tangents of the partial correlations. Compiled, because a diagnosis asks for it a thousand times.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.linear_mixed_model import MeanPrior
from skred.inference.hierarchical.event_density import integrated_log_density, inverse_factor
from skred.inference.hierarchical.population import LKJ_SHAPE
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN
from skred.inference.hierarchical.surface import Nodes
from skred.parallel.compile_cache import compiled, inner

FloatArray = NDArray[np.float64]
_LOG_MEDIAN, _LOG_SD, _SHAPE = math.log(SPREAD_MEDIAN), SPREAD_LOG_SD, LKJ_SHAPE
_LOG_2PI = math.log(2.0 * math.pi)
_HALF_LOG_2PI = 0.5 * _LOG_2PI
_NEGLIGIBLE = -25.0
"""Log share of an event's integral below which a node does not count for slopes."""
_STEP = 2e-3
"""Of the differences that a curvature is taken from, in the population's coordinates."""
_DEGREES = 5.0
"""Degrees of freedom of the importance proposal: tails heavy enough to bound the weights."""
_RESAMPLED_FROM = 8
"""Draws for each population that is kept: so many that resampling repeats few."""
_NARROWEST = _LOG_MEDIAN - 6.0 * _LOG_SD
"""Least log of a spread, six standard deviations of its prior below the median: 0.0036. Narrower populations
are between the nodes, whose sums then promise what is not there, tens of nats."""


@compiled()
def _factor(psi, n):  # type: ignore[no-untyped-def]
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
def _log_prior(psi, n, log_scale):  # type: ignore[no-untyped-def]
    """Log prior density in these coordinates, but for the constants of the correlations."""
    total = 0.0
    for i in range(n):
        # Half-normal median, in the logarithm.
        z = psi[i] - log_scale[i]
        total += 0.5 * math.log(2.0 / math.pi) - 0.5 * math.exp(2.0 * z) + z
        z = (psi[n + i] - _LOG_MEDIAN) / _LOG_SD
        total += -0.5 * z * z - math.log(_LOG_SD) - 0.5 * _LOG_2PI
    position = 2 * n
    for j in range(n):
        for _ in range(j + 1, n):
            shape = _SHAPE + 0.5 * (n - 2 - j)
            r = math.tanh(psi[position])
            total += shape * math.log(max(1.0 - r * r, 1e-300))
            position += 1
    return total


@inner()
def _log_target(psi, n, log_scale, first, points, log_weights):  # type: ignore[no-untyped-def]
    for i in range(n):
        if psi[n + i] < _NARROWEST:
            return -np.inf
    means = _means(psi, n, first.size - 1)
    density = integrated_log_density(means, _factor(psi, n), first, points, log_weights)
    total = _log_prior(psi, n, log_scale) + density.sum()
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
def _node_moments(psi, n, first, points, log_weights):  # type: ignore[no-untyped-def]
    """Sums over events: of log integrals, and of means and covariances of the statistics over the nodes.

    Each node counts by its share of its event's integral.
    """
    n_events, factor = first.size - 1, _factor(psi, n)
    whiten, log_determinant = inverse_factor(factor)
    density = integrated_log_density(_means(psi, n, n_events), factor, first, points, log_weights)
    constant = log_determinant - n * _HALF_LOG_2PI
    size = n + n * (n + 1) // 2
    mean, covariance = np.zeros(size), np.zeros((size, size))
    own, square, statistics = np.empty(size), np.empty((size, size)), np.empty(size)
    for event in range(n_events):
        own[:], square[:] = 0.0, 0.0
        for k in range(first[event], first[event + 1]):
            exponent = _fill_statistics(points[:, k], psi[:n], whiten, statistics)
            log_share = log_weights[k] + exponent + constant - density[event]
            if log_share < _NEGLIGIBLE:
                continue
            for i in range(size):
                part = math.exp(log_share) * statistics[i]
                own[i] += part
                for j in range(size):
                    square[i, j] += part * statistics[j]
        for i in range(size):
            mean[i] += own[i]
            for j in range(size):
                covariance[i, j] += square[i, j] - own[i] * own[j]
    return density.sum(), mean, covariance


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
    factor, between, offset = _factor(psi, n), np.zeros((n, n)), np.zeros(n)
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
    return _dot(mean, parameters) - n_events * normaliser + _log_prior(psi, n, log_scale), parameters


@compiled()
def _slopes(psi, n, log_scale, first, points, log_weights):  # type: ignore[no-untyped-def]
    """Log target, its gradient and minus its Hessian, with one sum over the nodes.

    An event's log integral is the cumulant function of the statistics of `_node_moments` in the population's
    natural parameters: its derivatives by those are their means and covariances. What remains, the natural
    parameters by the coordinates, and the prior, is without nodes and differenced.
    """
    log_integrals, mean, covariance = _node_moments(psi, n, first, points, log_weights)
    centre, (whiten, _) = psi[:n].copy(), inverse_factor(_factor(psi, n))
    n_events, size = first.size - 1, psi.size
    value = log_integrals + _log_prior(psi, n, log_scale)
    natural = np.empty((size, mean.size))
    gradient, hessian = np.empty(size), np.empty((size, size))
    fixed = n, log_scale, mean, n_events, centre, whiten
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
def _log_targets(psis, n, log_scale, first, points, log_weights):  # type: ignore[no-untyped-def]
    result = np.empty(len(psis))
    for k in range(len(psis)):
        result[k] = _log_target(psis[k], n, log_scale, first, points, log_weights)
    return result


def _allowed(psi: FloatArray, n: int) -> FloatArray:
    """The nearest coordinates whose spreads are not too narrow."""
    allowed = psi.copy()
    allowed[n : 2 * n] = np.maximum(psi[n : 2 * n], _NARROWEST)
    return allowed


def _climb(
    psi: FloatArray, n: int, log_scale: FloatArray, nodes: Nodes, n_steps: int
) -> tuple[FloatArray, float, FloatArray]:
    """Newton's method with halved steps: the top, its height, and minus the Hessian there."""
    psi = _allowed(psi, n)
    best, gradient, hessian = _slopes(psi, n, log_scale, *nodes)
    for _ in range(n_steps):
        values, axes = np.linalg.eigh(hessian)
        step = axes @ (axes.T @ gradient / np.maximum(np.abs(values), 0.5))
        step /= max(np.abs(step).max(), 1.0)
        gained, there = -1.0, psi
        for _ in range(8):
            there = _allowed(psi + step, n)
            gained = _log_targets(there[None], n, log_scale, *nodes)[0] - best
            if gained >= -1e-9:
                break
            step = 0.4 * (there - psi)
        if gained < -1e-9:
            break
        psi = there
        best, gradient, hessian = _slopes(psi, n, log_scale, *nodes)
        if gained < 1e-3:
            break
    return psi, best, hessian


class Evidence(NamedTuple):
    """What the population makes of nodes.

    Attributes
    ----------
    log_evidence : float
        By Laplace's formula.
    psi : (n_psi,) array
        Most probable population, in the coordinates of this module.
    covariance : (n_psi, n_psi) array
    """

    log_evidence: float
    psi: FloatArray
    covariance: FloatArray

    def population(self, n: int) -> Population:
        """The most probable population."""
        return population_at(self.psi[None], n)


def population_at(psi: FloatArray, n: int) -> Population:
    """Populations of `n` strengths at coordinates of this module, (n_groups, n_coordinates)."""
    factors = np.array([_factor(one, n) for one in psi])
    return Population(psi[:, :n].copy(), np.einsum("gij,gkj->gik", factors, factors))


def coordinates(population: Population, group: int = 0) -> FloatArray:
    """A group's population in the coordinates of this module."""
    covariance = population.covariance[group]
    n = len(covariance)
    spread = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance)
    partial = []
    for j in range(n):
        for i in range(j + 1, n):
            left = math.sqrt(max(covariance[i, i] - float(np.sum(factor[i, :j] ** 2)), 1e-12))
            partial.append(math.atanh(float(np.clip(factor[i, j] / left, -0.95, 0.95))))
    return np.concatenate([population.mean[group], np.log(spread), partial])


def _log_correlation_constant(n: int) -> float:
    """Of the prior of the partial correlations: (1 + r) / 2 is Beta(shape, shape)."""
    total = 0.0
    for j in range(n):
        shape = LKJ_SHAPE + 0.5 * (n - 2 - j)
        each = float(gammaln(2.0 * shape) - 2.0 * gammaln(shape)) - (2.0 * shape - 1.0) * math.log(2.0)
        total += (n - 1 - j) * each
    return total


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
    values, axes = np.linalg.eigh(hessian)
    values = np.maximum(values, 0.05)
    covariance = (axes / values) @ axes.T
    laplace = best + 0.5 * (len(psi) * _LOG_2PI - float(np.log(values).sum()))
    return Evidence(laplace + _log_correlation_constant(n), psi, covariance)


def importance_evidence(
    nodes: Nodes, log_scale: FloatArray, found: Evidence, n_draws: int, seed: int
) -> tuple[float, float]:
    """Evidence by importance sampling around the Laplace approximation, and its standard error in nats."""
    _, log_w = _weighted(nodes, log_scale, found, n_draws, np.random.default_rng([seed, 11]))
    most = float(log_w.max())
    weights = np.exp(log_w - most)
    mean = float(weights.mean())
    error = float(weights.std() / math.sqrt(n_draws) / mean)
    return most + math.log(mean) + _log_correlation_constant(len(log_scale)), error


def importance_draws(
    nodes: Nodes, log_scale: FloatArray, found: Evidence, n: int, rng: np.random.Generator
) -> FloatArray:
    """Draws of the population, (n, n_psi): the Laplace approximation's, many more, weighted and resampled."""
    draws, log_w = _weighted(nodes, log_scale, found, _RESAMPLED_FROM * n, rng)
    weights = np.exp(log_w - log_w.max())
    return draws[rng.choice(len(draws), size=n, p=weights / weights.sum())]


def _weighted(
    nodes: Nodes, log_scale: FloatArray, found: Evidence, n_draws: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draws around the Laplace approximation, from a wider and heavier-tailed density; log weights."""
    n = len(found.psi)
    factor = 1.15 * np.linalg.cholesky(found.covariance)
    normal = rng.standard_normal((n_draws, n))
    stretch = np.sqrt(_DEGREES / rng.chisquare(_DEGREES, n_draws))
    white = normal * stretch[:, None]
    draws = found.psi + white @ factor.T
    targets = _log_targets(draws, len(log_scale), log_scale, *nodes)
    log_t = float(gammaln(0.5 * (_DEGREES + n)) - gammaln(0.5 * _DEGREES))
    log_t -= 0.5 * n * math.log(_DEGREES * math.pi) + float(np.log(np.diag(factor)).sum())
    log_q = log_t - 0.5 * (_DEGREES + n) * np.log1p(np.sum(white**2, axis=1) / _DEGREES)
    return draws, np.nan_to_num(targets - log_q, nan=-np.inf)


def prior_log_scale(prior: MeanPrior) -> FloatArray:
    """Logarithm of the half-normal scales that a prior of the mean stands for."""
    from skred.diagnosis.evidence.linear_mixed_model import MEDIAN_LOG_MEAN

    result: FloatArray = prior.mean - MEDIAN_LOG_MEAN
    return result
