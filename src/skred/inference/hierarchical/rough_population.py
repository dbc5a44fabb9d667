"""Approximate population: expectation-maximisation on coarse likelihood surfaces.

It only decides where and how finely surfaces are resolved; nothing is inferred from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.inference.hierarchical.bisection import Envelope
from skred.inference.hierarchical.surface import Surfaces

SPREAD_MEDIAN, SPREAD_LOG_SD = 0.13, 0.6
"""Prior of a population's standard deviation of a strength's logarithm: log-normal."""
_SEARCH, _ITERATIONS, _ENOUGH = 30, 300, 1e-4
"""Steps after which the population is found, steps at most, and change below which they end."""
MEDIAN_LOG_MEAN, MEDIAN_LOG_SD = -0.64, 1.1
"""Mean and standard deviation of the log of a half-normal variable of scale 1."""
STARTING_SPREAD = 0.3
"""Spread to begin with: wider than most, so that no event is out of reach."""
PRIOR_EVENTS = 2.0
"""Events that a prior spread counts for where correlations are estimated: keeps a covariance regular with few
events."""
_REACH = 2.5
"""Distance, in posterior standard deviations, up to which populations are expected."""
_AROUND = 2.0
"""How much wider, in variance, than the mean over some populations an envelope of them is."""
_CELL_IN_SPREADS, _LEAST_CELL, _LARGEST_CELL = 1.0, 0.02, 0.25
"""Width of a patch in the narrowest spread to be expected, and its limits."""


@dataclass(frozen=True, eq=False)
class RoughPopulation:
    """A population and how uncertain it is, by strength.

    Attributes
    ----------
    mean : (n_strengths,) array
        Of the logarithms of the strengths.
    mean_sd : (n_strengths,) array
        Posterior standard deviation of that.
    spread : (n_strengths,) array
        Standard deviation across events.
    log_spread_sd : (n_strengths,) array
        Posterior standard deviation of its logarithm.
    correlation : (n_strengths, n_strengths) array
    """

    mean: FloatArray
    mean_sd: FloatArray
    spread: FloatArray
    log_spread_sd: FloatArray
    correlation: FloatArray

    @property
    def cell(self) -> FloatArray:
        """Size of a patch over which even the narrowest population to be expected varies little."""
        narrowest = self.spread * np.exp(-_REACH * self.log_spread_sd)
        return np.clip(_CELL_IN_SPREADS * narrowest, _LEAST_CELL, _LARGEST_CELL)

    def envelope(self, inflation: float = 1.0) -> Envelope:
        """Envelope of all populations to be expected, its variances times `inflation`."""
        widest = self.spread * np.exp(_REACH * self.log_spread_sd)
        covariance = np.outer(widest, widest) * self.correlation + np.diag((2.0 * self.mean_sd) ** 2)
        return Envelope(self.mean, np.linalg.inv(np.linalg.cholesky(inflation * covariance)))


def rough_population(surfaces: Surfaces, prior_mean: FloatArray, prior_sd: FloatArray) -> RoughPopulation:
    """Find the population.

    Parameters
    ----------
    surfaces : Surfaces
    prior_mean, prior_sd : (n_strengths,) arrays
        Of the population mean.
    """
    n, n_events = len(prior_mean), len(surfaces.first) - 1
    points, within = surfaces.mean[:, :n], surfaces.covariance[:, :n, :n]
    event = np.repeat(np.arange(n_events), np.diff(surfaces.first))
    mean, covariance = prior_mean.copy(), np.eye(n)
    for iteration in range(_ITERATIONS):
        weight = _weights(surfaces, event, points, mean, covariance)
        precision = np.linalg.inv(covariance)
        centre = np.linalg.solve(
            n_events * precision + np.diag(prior_sd**-2.0),
            precision @ (weight @ points) + prior_mean / prior_sd**2,
        )
        moment = _moment(points - centre, weight, within)
        spread, correlation = _spreads(moment, n_events)
        change = np.abs(centre - mean).max() + np.abs(spread**2 - np.diag(covariance)).max()
        mean, covariance = centre, np.outer(spread, spread) * correlation
        if iteration == _SEARCH:  # found; from here on what the data leave open is the prior's
            covariance = np.minimum(spread, STARTING_SPREAD) ** 2 * np.eye(n)
        elif iteration > _SEARCH and change < _ENOUGH:
            break
    own = _own_variance(points, weight, within, event, n_events)
    informed = np.clip(1.0 - own / spread**2, 0.0, 1.0)
    mean_sd = 1.0 / np.sqrt(prior_sd**-2.0 + informed.sum(axis=0) / spread**2)
    log_spread_sd = 1.0 / np.sqrt(SPREAD_LOG_SD**-2.0 + 2.0 * np.sum(informed**2, axis=0))
    return RoughPopulation(mean, mean_sd, spread, log_spread_sd, correlation)


def envelope_around(means: FloatArray, factors: FloatArray) -> Envelope:
    """Envelope of some populations and no others; arguments as of `moments_of`."""
    mean, covariance = moments_of(means, factors)
    return Envelope(mean, np.linalg.inv(np.linalg.cholesky(_AROUND * covariance)))


def moments_of(means: FloatArray, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of some populations taken together.

    Parameters
    ----------
    means : (n, n_strengths) array
        Of the logarithms of the strengths.
    factors : (n, n_strengths, n_strengths) array
        Lower Cholesky factors of their covariances.
    """
    deviation = means - means.mean(axis=0)
    between = deviation.T @ deviation / len(means)
    within = np.einsum("nij,nkj->ik", factors, factors) / len(means)
    return means.mean(axis=0), within + between


def _weights(
    surfaces: Surfaces, event: IntArray, points: FloatArray, mean: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Posterior weight of each patch within its event."""
    z = np.linalg.solve(np.linalg.cholesky(covariance), (points - mean).T)
    exponent = surfaces.log_weights - 0.5 * np.sum(z * z, axis=0)
    weight = np.exp(exponent - np.maximum.reduceat(exponent, surfaces.first[:-1])[event])
    normalised: FloatArray = weight / np.bincount(event, weight)[event]
    return normalised


def _moment(deviation: FloatArray, weight: FloatArray, within: FloatArray) -> FloatArray:
    """Sum over events of the expected square of the deviation from the mean."""
    between = np.einsum("k,ki,kj->ij", weight, deviation, deviation)
    total: FloatArray = between + np.einsum("k,kij->ij", weight, within)
    return total


def _spreads(moment: FloatArray, n_events: int) -> tuple[FloatArray, FloatArray]:
    """Most probable spreads under their log-normal prior, by Newton's method, and correlation."""
    squares = np.diag(moment)
    log_spread = 0.5 * np.log(squares / n_events + 1e-12)
    for _ in range(20):
        ratio = squares * np.exp(-2.0 * log_spread)
        slope = n_events - ratio + (log_spread - math.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD**2
        log_spread = log_spread - np.clip(slope / (2.0 * ratio + SPREAD_LOG_SD**-2.0), -1.0, 1.0)
    regular = moment + PRIOR_EVENTS * SPREAD_MEDIAN**2 * np.eye(len(moment))
    scale = np.sqrt(np.diag(regular))
    return np.exp(log_spread), regular / np.outer(scale, scale)


def _own_variance(
    points: FloatArray, weight: FloatArray, within: FloatArray, event: IntArray, n_events: int
) -> FloatArray:
    """Posterior variance of each event's own logarithms, (n_events, n_strengths)."""
    own = np.empty((n_events, points.shape[1]))
    for k in range(points.shape[1]):
        mean = np.bincount(event, weight * points[:, k], n_events)
        square = np.bincount(event, weight * (points[:, k] ** 2 + within[:, k, k]), n_events)
        own[:, k] = square - mean**2
    return own
