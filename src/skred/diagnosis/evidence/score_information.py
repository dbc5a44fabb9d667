"""How the log likelihood of each reading changes with its prediction: slope and curvature, in numba.

The curvature is that of Gauss and Newton: a reading counts with its precision, an outlying one with
less. What an error common to an event's velocities takes from that is the product of a vector with itself.
"""

from __future__ import annotations

import math

import numpy as np

from skred.inference.bounds import bound_slopes, log_bound
from skred.inference.error_model import OUTLIER_FACTOR
from skred.inference.reading_table import (
    LEAST,
    MOST,
    OBSERVED,
    RELATIVE,
    VALUE,
    VELOCITY,
    is_bounded,
    reading_sd,
    tabled,
)
from skred.parallel.compile_cache import compiled, inner

_SQRT_2 = math.sqrt(2.0)
_SQRT_2PI = math.sqrt(2.0 * math.pi)
_FAR = 6.0
"""Standard deviations beyond which the slope of a normal tail is taken from its asymptote: the tail itself
underflows."""


@inner()
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


@inner()
def _common_slopes(table, row, predictions, i, common, slope, curvature, shared):  # type: ignore[no-untyped-def]
    """Fill slope, curvature and what is shared of a run whose velocities have an error in common."""
    n_velocities, total = 0, 0.0
    n_sensors = table.shape[1]
    for j in range(n_sensors):
        if table[row, j, OBSERVED] > 0.0 and table[row, j, VELOCITY] > 0.0:
            n_velocities += 1
            sd = reading_sd(table, row, j, predictions[i, j])
            total += (table[row, j, VALUE] - predictions[i, j]) / sd / (1.0 - common)
    taken = common / (1.0 + common * n_velocities / (1.0 - common))
    for j in range(n_sensors):
        if table[row, j, OBSERVED] == 0.0:
            continue
        sd = reading_sd(table, row, j, predictions[i, j])
        z = (table[row, j, VALUE] - predictions[i, j]) / sd
        own, part = (1.0 - common, 1.0) if table[row, j, VELOCITY] > 0.0 else (1.0, 0.0)
        # 0 where the standard deviation is stated, and not the prediction's own.
        d_log_sd = table[row, j, RELATIVE] ** 2 * predictions[i, j] / sd**2
        slope[i, j] = (z - part * taken * total) / own * (1.0 / sd + z * d_log_sd) - d_log_sd
        curvature[i, j] = 1.0 / (own * sd**2) + 2.0 * d_log_sd**2
        shared[i, j] = part * math.sqrt(taken) / (own * sd)


@inner()
def _fill_bound_slopes(  # type: ignore[no-untyped-def]
    table, row, predictions, i, weights, scales, shares, degrees, slope, curvature
):
    """Fill slope and curvature of readings known by bounds only, over the cases by their weights."""
    for j in range(table.shape[1]):
        if not is_bounded(table, row, j):
            continue
        prediction = predictions[i, j]
        width = reading_sd(table, row, j, prediction)
        d_sd = table[row, j, RELATIVE] ** 2 * prediction / width
        for case in range(weights.size):
            wide = width * scales[case]
            low, high = (table[row, j, LEAST] - prediction) / wide, (table[row, j, MOST] - prediction) / wide
            own = bound_slopes(low, high, shares[case], d_sd * scales[case], degrees > 0.0)
            slope[i, j] += weights[case] * own[0] / wide
            curvature[i, j] += weights[case] * own[1] / (wide * wide)


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
    # Unpacked once, see `tabled`.
    table, place_sd = tabled(readings), readings.place_sd
    reached, not_reached = readings.reached, readings.not_reached
    scales, shares, degrees, common = errors.scales, errors.shares, errors.degrees, errors.common
    log_weights, log_scales = errors.log_weights, errors.log_scales
    n_cases = log_weights.size
    log_case, weights = np.empty(n_cases), np.empty(n_cases)
    sd, residual = np.empty(n_columns), np.empty(n_columns)
    wide_square = OUTLIER_FACTOR * OUTLIER_FACTOR
    for i in range(n):
        row = rows[i]
        stop = predictions[i, n_columns - 1]
        at_stop, bend = _stop_slopes(stop, reached[row], not_reached[row], place_sd)
        slope[i, n_columns - 1], curvature[i, n_columns - 1] = at_stop, bend
        if common > 0.0:
            _common_slopes(table, row, predictions, i, common, slope, curvature, shared)
            weights[0] = 1.0  # these errors are one case
            _fill_bound_slopes(table, row, predictions, i, weights, scales, shares, degrees, slope, curvature)
            continue
        for case in range(n_cases):
            log_case[case] = log_weights[case]
        for j in range(n_columns - 1):
            if is_bounded(table, row, j):
                width = reading_sd(table, row, j, predictions[i, j])
                low, high = table[row, j, LEAST] - predictions[i, j], table[row, j, MOST] - predictions[i, j]
                for case in range(n_cases):
                    wide = width * scales[case]
                    log_case[case] += log_bound(low / wide, high / wide, shares[case], degrees > 0.0)
            if table[row, j, OBSERVED] == 0.0:
                continue
            sd[j] = reading_sd(table, row, j, predictions[i, j])
            residual[j] = table[row, j, VALUE] - predictions[i, j]
            for case in range(n_cases):
                square = (residual[j] / (sd[j] * scales[case])) ** 2
                share = shares[case]
                log_case[case] -= log_scales[case]
                if degrees > 0.0:
                    log_case[case] -= 0.5 * (degrees + 1.0) * math.log1p(square / degrees)
                else:
                    usual = (1.0 - share) * math.exp(-0.5 * square)
                    outlying = share / OUTLIER_FACTOR * math.exp(-0.5 * square / wide_square)
                    log_case[case] += math.log(max(usual + outlying, 1e-300))
        most, total = log_case.max(), 0.0
        for case in range(n_cases):
            weights[case] = math.exp(log_case[case] - most)
            total += weights[case]
        weights /= total
        _fill_bound_slopes(table, row, predictions, i, weights, scales, shares, degrees, slope, curvature)
        for j in range(n_columns - 1):
            if table[row, j, OBSERVED] == 0.0:
                continue
            precision = 0.0
            for case in range(n_cases):
                own = 1.0 / (sd[j] * scales[case]) ** 2
                square = residual[j] * residual[j] * own
                if degrees > 0.0:
                    own *= (degrees + 1.0) / (degrees + square)
                elif shares[case] > 0.0:
                    odds = shares[case] / (OUTLIER_FACTOR * (1.0 - shares[case]))
                    odds *= math.exp(min(0.5 * square * (1.0 - 1.0 / wide_square), 600.0))
                    own *= (1.0 + odds / wide_square) / (1.0 + odds)
                precision += weights[case] * own
            # 0 where the standard deviation is stated, and not the prediction's own.
            d_log_sd = table[row, j, RELATIVE] ** 2 * predictions[i, j] / sd[j] ** 2
            slope[i, j] = precision * residual[j] + d_log_sd * (precision * residual[j] ** 2 - 1.0)
            curvature[i, j] = precision + 2.0 * d_log_sd * d_log_sd
    return slope, curvature, shared
