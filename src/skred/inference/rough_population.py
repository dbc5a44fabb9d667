"""Where the population is, roughly: expectation-maximisation on coarse surfaces.

It only decides where surfaces are resolved finely; nothing is inferred from it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skred.inference.bisection import Envelope
from skred.inference.surface import Surfaces

FloatArray = NDArray[np.float64]
SPREAD_MEDIAN, SPREAD_LOG_SD = 0.13, 0.6
"""Prior of a population's standard deviation of a strength's logarithm: log-normal."""
_ITERATIONS = 200
_PRIOR_EVENTS = 2.0
_ENOUGH = 1e-4
_LEAST_SPREAD = 0.03


def rough_population(
    surfaces: Surfaces, prior_mean: FloatArray, prior_sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of the logarithms of the strengths, (n,) and (n, n).

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
    for _ in range(_ITERATIONS):
        z = np.linalg.solve(np.linalg.cholesky(covariance), (points - mean).T)
        exponent = surfaces.log_weights - 0.5 * np.sum(z * z, axis=0)
        weight = np.exp(exponent - np.maximum.reduceat(exponent, surfaces.first[:-1])[event])
        weight /= np.bincount(event, weight)[event]
        precision = np.linalg.inv(covariance)
        centre = np.linalg.solve(
            n_events * precision + np.diag(prior_sd**-2.0),
            precision @ (weight @ points) + prior_mean / prior_sd**2,
        )
        deviation = points - centre
        moment = np.einsum("k,ki,kj->ij", weight, deviation, deviation)
        moment += np.einsum("k,kij->ij", weight, within) + _PRIOR_EVENTS * SPREAD_MEDIAN**2 * np.eye(n)
        change = np.abs(centre - mean).max()
        mean, covariance = centre, moment / (n_events + _PRIOR_EVENTS)
        if change < _ENOUGH:
            break
    return mean, covariance


def envelope_around(mean: FloatArray, covariance: FloatArray, n_events: int) -> Envelope:
    """Envelope of all populations that a campaign of so many events may have."""
    inflation = (1.5 + 4.0 / math.sqrt(2.0 * n_events)) ** 2 + 4.0 / n_events
    wide = inflation * covariance + _LEAST_SPREAD**2 * np.eye(len(mean))
    return Envelope(mean, np.linalg.inv(np.linalg.cholesky(wide)))
