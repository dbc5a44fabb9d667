"""How the log likelihood of each reading changes with its prediction: slope and curvature, in numba.

The curvature is that of Gauss and Newton: a reading counts with its precision, an outlying one with
less. What an error common to an event's velocities takes from that is the product of a vector with itself.
"""

from __future__ import annotations

import math

import numpy as np

from skred.diagnosis.compiled import compiled
from skred.inference.reading_density import OUTLIER_FACTOR, reading_sd

_SQRT_2 = math.sqrt(2.0)
_SQRT_2PI = math.sqrt(2.0 * math.pi)
_FAR = 6.0


@compiled()
def _stop_slopes(stop, reached, not_reached, place_sd):  # type: ignore[no-untyped-def]
    """Slope and curvature of the log probability that a stop is seen between two places."""
    if reached == -np.inf and not_reached == np.inf:
        return 0.0, 0.0
    low, high = (reached - stop) / place_sd, (not_reached - stop) / place_sd
    if low > _FAR:
        return (low + 1.0 / low) / place_sd, 1.0 / place_sd**2
    if high < -_FAR:
        return (high + 1.0 / high) / place_sd, 1.0 / place_sd**2
    inside = 0.5 * (math.erfc(-high / _SQRT_2) - math.erfc(-low / _SQRT_2))
    inside = max(inside, 1e-12)
    at_low = math.exp(-0.5 * low * low) / _SQRT_2PI if low > -np.inf else 0.0
    at_high = math.exp(-0.5 * high * high) / _SQRT_2PI if high < np.inf else 0.0
    slope = (at_low - at_high) / inside
    bend = (low * at_low if at_low > 0.0 else 0.0) - (high * at_high if at_high > 0.0 else 0.0)
    curvature = slope * slope - bend / inside
    return slope / place_sd, min(max(curvature, 0.0), 1.0) / place_sd**2


@compiled()
def _common_slopes(row, prediction, readings, common, slope, curvature, shared):  # type: ignore[no-untyped-def]
    """Fill slope, curvature and what is shared of a row whose velocities have an error in common."""
    n_velocities, total = 0, 0.0
    n_columns = prediction.size
    for j in range(n_columns - 1):
        if readings.observed[row, j] and readings.is_velocity[j]:
            n_velocities += 1
            sd = reading_sd(row, j, prediction[j], readings)
            total += (readings.values[row, j] - prediction[j]) / sd / (1.0 - common)
    taken = common / (1.0 + common * n_velocities / (1.0 - common))
    for j in range(n_columns - 1):
        if not readings.observed[row, j]:
            continue
        sd = reading_sd(row, j, prediction[j], readings)
        z = (readings.values[row, j] - prediction[j]) / sd
        own, part = (1.0 - common, 1.0) if readings.is_velocity[j] else (1.0, 0.0)
        d_log_sd = 0.0
        if readings.stated_sd[row, j] <= 0.0:  # the standard deviation is the prediction's own
            d_log_sd = readings.relative_sd[j] ** 2 * prediction[j] / sd**2
        slope[j] = (z - part * taken * total) / own * (1.0 / sd + z * d_log_sd) - d_log_sd
        curvature[j] = 1.0 / (own * sd**2) + 2.0 * d_log_sd**2
        shared[j] = part * math.sqrt(taken) / (own * sd)


@compiled()
def reading_slopes(rows, predictions, readings, errors):  # type: ignore[no-untyped-def]
    """Slope and curvature of the log likelihood by each prediction.

    Parameters
    ----------
    rows : (n,) integer array
        Which row of the readings each prediction is for.
    predictions : (n, n_sensors + 1) array
        The runout last.
    readings : EventReadings
    errors : Errors

    Returns
    -------
    slope, curvature, shared : (n, n_sensors + 1) arrays
        The information of a row's readings is the diagonal matrix of the curvatures less the product of
        what is shared with itself.
    """
    n, n_columns = predictions.shape
    slope, curvature = np.zeros((n, n_columns)), np.zeros((n, n_columns))
    shared = np.zeros((n, n_columns))
    n_cases = errors.weights.size
    log_case = np.empty(n_cases)
    sd, residual = np.empty(n_columns), np.empty(n_columns)
    wide_square = OUTLIER_FACTOR * OUTLIER_FACTOR
    for i in range(n):
        row = rows[i]
        at_stop, bend = _stop_slopes(
            predictions[i, n_columns - 1], readings.reached[row], readings.not_reached[row], readings.place_sd
        )
        slope[i, n_columns - 1], curvature[i, n_columns - 1] = at_stop, bend
        if errors.common > 0.0:
            one = slope[i], curvature[i], shared[i]
            _common_slopes(row, predictions[i], readings, errors.common, *one)
            continue
        log_case[:] = np.log(errors.weights)
        for j in range(n_columns - 1):
            if not readings.observed[row, j]:
                continue
            p = predictions[i, j]
            sd[j] = readings.stated_sd[row, j]
            if sd[j] <= 0.0:
                sd[j] = math.hypot(readings.relative_sd[j] * p, readings.absolute_sd[j])
            residual[j] = readings.values[row, j] - p
            for case in range(n_cases):
                square = (residual[j] / (sd[j] * errors.scales[case])) ** 2
                share = errors.shares[case]
                log_case[case] -= math.log(errors.scales[case])
                if errors.degrees > 0.0:
                    log_case[case] -= 0.5 * (errors.degrees + 1.0) * math.log1p(square / errors.degrees)
                else:
                    usual = (1.0 - share) * math.exp(-0.5 * square)
                    outlying = share / OUTLIER_FACTOR * math.exp(-0.5 * square / wide_square)
                    log_case[case] += math.log(max(usual + outlying, 1e-300))
        weights = np.exp(log_case - log_case.max())
        weights /= weights.sum()
        for j in range(n_columns - 1):
            if not readings.observed[row, j]:
                continue
            precision = 0.0
            for case in range(n_cases):
                own = 1.0 / (sd[j] * errors.scales[case]) ** 2
                square = residual[j] * residual[j] * own
                if errors.degrees > 0.0:
                    own *= (errors.degrees + 1.0) / (errors.degrees + square)
                elif errors.shares[case] > 0.0:
                    odds = errors.shares[case] / (OUTLIER_FACTOR * (1.0 - errors.shares[case]))
                    odds *= math.exp(min(0.5 * square * (1.0 - 1.0 / wide_square), 600.0))
                    own *= (1.0 + odds / wide_square) / (1.0 + odds)
                precision += weights[case] * own
            slope[i, j] = precision * residual[j]
            curvature[i, j] = precision
            if readings.stated_sd[row, j] <= 0.0:  # the standard deviation is the prediction's own
                d_log_sd = readings.relative_sd[j] ** 2 * predictions[i, j] / sd[j] ** 2
                slope[i, j] += d_log_sd * (precision * residual[j] ** 2 - 1.0)
                curvature[i, j] += 2.0 * d_log_sd * d_log_sd
    return slope, curvature, shared
