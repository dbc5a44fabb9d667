"""Mean and covariance of the recordings across events, incomplete rows included.

Maximum likelihood for a multivariate normal by expectation-maximisation: missing readings are
marginalised, and of a sensor that was not reached only that its latent reading is at most zero is known.
Dempster, Laird and Rubin (1977), doi:10.1111/j.2517-6161.1977.tb01600.x.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from skred.arrays import BoolArray, FloatArray
from skred.inference.pooled.orthant import log_orthant_probability, truncate

TOLERANCE = 1e-9
"""Largest last change of any mean or covariance, in standard deviations of the sensors."""
MAX_ITERATIONS = 20_000
"""Steps of expectation-maximisation after which it is told that it does not converge."""
SMALLEST_EIGENVALUE = 1e-8
"""Of the correlation matrix; below it some sensors are a fixed combination of others."""
_MOST_NAMED = 5
"""Sensors that a message names one by one."""
LIKELIHOOD_SLACK = 1e-6
"""Fall of the log likelihood that the quadrature of censored readings may cause."""


def recordings_covariance(
    values: ArrayLike, not_reached: ArrayLike, sensors: Sequence[str] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Estimate the recordings' mean and covariance across events.

    The covariance is the maximum likelihood estimate (divisor: number of events) without any shrinkage:
    data that do not determine a positive definite one are refused.

    Parameters
    ----------
    values : (n_events, n_sensors) array
        Readings, NaN where there is none or the sensor was not reached.
    not_reached : (n_events, n_sensors) array of bool
        Where the front stopped above the sensor: the latent reading is at most 0.
    sensors : sequence of str, optional
        Their ids, for what is said of them; by default their numbers from 1.

    Returns
    -------
    mean : (n_sensors,) array
    covariance : (n_sensors, n_sensors) array

    Raises
    ------
    ValueError
        If the arrays contradict each other or the data cannot determine the covariance.
    """
    values, not_reached = _checked(values, not_reached, sensors)
    mean = np.nanmean(values, axis=0)
    covariance = np.diag(np.nanvar(values, axis=0))
    log_likelihood = -np.inf
    for _ in range(MAX_ITERATIONS):
        before = log_likelihood
        new_mean, new_covariance, log_likelihood = em_step(values, not_reached, mean, covariance)
        if log_likelihood < before - LIKELIHOOD_SLACK:
            raise ArithmeticError(f"the log likelihood fell from {before} to {log_likelihood}")
        sd = np.sqrt(np.diag(new_covariance))
        _check_rank(new_covariance / np.outer(sd, sd))
        change = max(
            np.max(np.abs(new_mean - mean) / sd),
            np.max(np.abs(new_covariance - covariance) / np.outer(sd, sd)),
        )
        mean, covariance = new_mean, new_covariance
        if change < TOLERANCE:
            return mean, covariance
    raise ValueError(
        f"the recordings do not determine their covariance: no maximum within {MAX_ITERATIONS} iterations"
    )


def observed_log_likelihood(
    values: FloatArray, not_reached: BoolArray, mean: FloatArray, covariance: FloatArray
) -> float:
    """Return the log likelihood of what was recorded, missing and not reached included."""
    total = 0.0
    for reading, censored in zip(values, not_reached, strict=True):
        observed = np.isfinite(reading)
        log_density, latent = _condition(reading, observed, censored, mean, covariance)
        total += log_density
        if censored.any():
            total += log_orthant_probability(*latent, np.zeros(censored.sum()))
    return total


def em_step(
    values: FloatArray, not_reached: BoolArray, mean: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """One step of expectation and maximisation.

    Returns
    -------
    mean, covariance : arrays
        Their next values.
    log_likelihood : float
        Of the values they came from.
    """
    expected = np.empty_like(values)
    spread = np.zeros_like(covariance)
    total = 0.0
    for event, (reading, censored) in enumerate(zip(values, not_reached, strict=True)):
        observed = np.isfinite(reading)
        log_density, latent = _condition(reading, observed, censored, mean, covariance)
        total += log_density
        known = observed | censored
        # The reading itself, or the moments of what is known to lie below zero ...
        known_expected = np.where(observed, reading, 0.0)
        known_spread = np.zeros_like(covariance)
        if censored.any():
            below_zero = truncate(*latent, np.zeros(censored.sum()))
            total += below_zero.log_probability
            known_expected[censored] = below_zero.mean
            known_spread[np.ix_(censored, censored)] = below_zero.covariance
        # ... and by regression on those whatever is missing.
        missing = ~known
        k = np.ix_(known, known)
        slope = np.eye(len(mean))
        slope[:, missing] = 0.0
        slope[np.ix_(missing, known)] = np.linalg.solve(covariance[k], covariance[np.ix_(known, missing)]).T
        expected[event] = mean + slope @ np.where(known, known_expected - mean, 0.0)
        residual = np.zeros_like(covariance)
        m = np.ix_(missing, missing)
        residual[m] = covariance[m] - slope[np.ix_(missing, known)] @ covariance[np.ix_(known, missing)]
        spread += slope @ known_spread @ slope.T + residual
    new_mean = expected.mean(axis=0)
    centred = expected - new_mean
    new_covariance = (centred.T @ centred + spread) / len(values)
    return new_mean, (new_covariance + new_covariance.T) / 2, total


def _condition(
    reading: FloatArray, observed: BoolArray, censored: BoolArray, mean: FloatArray, covariance: FloatArray
) -> tuple[float, tuple[FloatArray, FloatArray]]:
    """Log density of the observed readings; mean and covariance of the censored ones given them."""
    across = covariance[np.ix_(observed, censored)]
    factor = np.linalg.cholesky(covariance[np.ix_(observed, observed)])
    residual = np.linalg.solve(factor, reading[observed] - mean[observed])
    whitened = np.linalg.solve(factor, across)
    log_density = -0.5 * residual @ residual - np.log(np.diag(factor)).sum()
    log_density -= 0.5 * observed.sum() * np.log(2 * np.pi)
    conditional = covariance[np.ix_(censored, censored)] - whitened.T @ whitened
    return float(log_density), (mean[censored] + whitened.T @ residual, conditional)


def _checked(
    values: ArrayLike, not_reached: ArrayLike, sensors: Sequence[str] | None
) -> tuple[FloatArray, BoolArray]:
    """Arrays of the events that have information; raises where they do not suffice."""
    values, not_reached = np.asarray(values, dtype=float), np.asarray(not_reached, dtype=bool)
    if values.ndim != 2 or values.shape != not_reached.shape:
        raise ValueError(f"expected two (event, sensor) arrays, found {values.shape} and {not_reached.shape}")
    if np.isinf(values).any() or (np.isfinite(values) & not_reached).any():
        raise ValueError("a reading is a finite number, and there is none where a sensor was not reached")
    known = np.isfinite(values) | not_reached
    n_sensors = values.shape[1]
    if known.any(axis=1).sum() < 2:
        raise ValueError(
            f"{known.any(axis=1).sum()} avalanche has readings, and the pooled likelihood compares"
            f" avalanches: it needs at least {n_sensors + 1}; --likelihood hierarchical takes a single one"
        )
    unseen = np.flatnonzero([len(np.unique(v[np.isfinite(v)])) < 2 for v in values.T])
    if len(unseen):
        ids = [f"number {k + 1}" if sensors is None else f"'{sensors[k]}'" for k in unseen[:_MOST_NAMED]]
        more = f" and {len(unseen) - _MOST_NAMED} more" if len(unseen) > _MOST_NAMED else ""
        raise ValueError(
            f"sensor {', '.join(ids)}{more}: fewer than two different readings; leave out such a sensor, or"
            " take --likelihood hierarchical"
        )
    complete = int(known.all(axis=1).sum())
    if complete < n_sensors + 1:
        raise ValueError(
            f"{complete} events are recorded or not reached at all {n_sensors} sensors;"
            f" their covariance needs at least {n_sensors + 1}: add events, or leave out a sensor"
        )
    # An event without any knowledge would only slow the iteration down.
    return values[known.any(axis=1)], not_reached[known.any(axis=1)]


def _check_rank(correlation: FloatArray) -> None:
    smallest = np.linalg.eigvalsh(correlation)[0]
    if smallest < SMALLEST_EIGENVALUE:
        raise ValueError(
            "the recordings' covariance is singular: some sensors repeat a combination of others"
            f" (smallest eigenvalue of the correlation {smallest:.1e})"
        )
