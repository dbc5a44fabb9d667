"""Densities of one event's readings given a front, and their bounds, in numba."""

from __future__ import annotations

import math

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.inference.bounds import fill_log_bounds
from skred.inference.error_model import OUTLIER_FACTOR, Errors, EventReadings
from skred.inference.reading_table import (
    ABSOLUTE,
    OBSERVED,
    RELATIVE,
    VALUE,
    VELOCITY,
    bounded_events,
    flatten,
    is_bounded,
    reading_sd,
    tabled,
)
from skred.parallel.compile_cache import compiled, inner

_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)
_SQRT_HALF = math.sqrt(0.5)
_LEAST = 1e-300
"""Least density whose logarithm is taken."""
_TINY, _SMALL = 1e-30, 1e-200
"""Densities below the first are taken by their logarithm; products below the second are put away."""
_COMMON_STEPS, _COMMON_STEP = 28, 0.5
"""Trapezoids over an error that velocities share, in its standard deviations: from -14 to 14 in steps of a
half."""
_SCALE, _SHARE, _LOG_WEIGHT, _LOG_SCALE = range(4)
"""A case of the mixture, as `_cases_of` has it."""


@inner()
def _cases_of(errors):  # type: ignore[no-untyped-def]
    """All cases of the mixture in one array, (n_cases, 4)."""
    scales, shares = errors.scales, errors.shares
    log_weights, log_scales = errors.log_weights, errors.log_scales
    cases = np.empty((scales.size, 4))
    for k in range(scales.size):
        cases[k, _SCALE], cases[k, _SHARE] = scales[k], shares[k]
        cases[k, _LOG_WEIGHT], cases[k, _LOG_SCALE] = log_weights[k], log_scales[k]
    return cases


@inner()
def _log_stop(stop, reached, not_reached, place_sd):  # type: ignore[no-untyped-def]
    """Log probability that a front that stops at `stop` is seen to stop between two places."""
    above = (reached - stop) / place_sd * _SQRT_HALF
    below = (not_reached - stop) / place_sd * _SQRT_HALF
    if above > 0.0:  # from the upper tail, where the difference does not cancel
        probability = 0.5 * (math.erfc(above) - math.erfc(below))
    else:
        probability = 0.5 * (math.erfc(-below) - math.erfc(-above))
    return math.log(max(probability, _LEAST))


@inner()
def _unshifted(table, event, j, shift):  # type: ignore[no-untyped-def]
    """The prediction whose reading, `shift` standard deviations higher, is the value.

    The standard deviation is the prediction's own, which makes it the root of a quadratic equation.
    """
    value = table[event, j, VALUE]
    absolute, relative = shift * table[event, j, ABSOLUTE], shift * table[event, j, RELATIVE]
    if relative == 0.0:
        return value - absolute
    inside = absolute * absolute * (1.0 - relative * relative) + relative * relative * value * value
    root = math.copysign(math.sqrt(max(inside, 0.0)), shift)
    below = value + root
    if abs(below) > 1e-9 * abs(value) + 1e-12:
        return (value * value - absolute * absolute) / below
    return value - shift * reading_sd(table, event, j, value)


@inner()
def _nearest(table, event, j, low, high, shift):  # type: ignore[no-untyped-def]
    """The residual of smallest size, and its standard deviation, for predictions between two values.

    `shift` is an error common to the velocities, in standard deviations of theirs.
    """
    value = table[event, j, VALUE]
    if shift == 0.0 or table[event, j, VELOCITY] == 0.0:
        shift = 0.0
        nearest = value
    else:
        nearest = _unshifted(table, event, j, shift)
    prediction = min(max(nearest, low), high)
    sd = reading_sd(table, event, j, prediction)
    return value - prediction - shift * sd, sd


@inner()
def _put_away(product, total):  # type: ignore[no-untyped-def]
    """A product and a sum of logarithms: the product moved into the sum where it gets out of range."""
    if _SMALL < product < 1.0 / _SMALL:
        return product, total
    return 1.0, total + math.log(product)


@inner()
def _log_student(table, event, low, high, run, scale, degrees):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings under Student's t, in one case of the mixture."""
    n = 0
    product_sd, product_tail, total_sd, total_tail = 1.0, 1.0, 0.0, 0.0
    for j in range(table.shape[1]):
        if table[event, j, OBSERVED] > 0.0:
            residual, sd = _nearest(table, event, j, low[run, j], high[run, j], 0.0)
            wide = sd * scale
            product_sd, total_sd = _put_away(product_sd * wide, total_sd)
            tail = 1.0 + (residual / wide) ** 2 / degrees
            product_tail, total_tail = _put_away(product_tail * tail, total_tail)
            n += 1
    constant = math.lgamma(0.5 * (degrees + 1.0)) - math.lgamma(0.5 * degrees)
    constant -= 0.5 * math.log(degrees * math.pi)
    log_sd, log_tail = total_sd + math.log(product_sd), total_tail + math.log(product_tail)
    return n * constant - log_sd - 0.5 * (degrees + 1.0) * log_tail


@inner()
def _multiplied(product, total, usual, outlying, square, share):  # type: ignore[no-untyped-def]
    """A product of densities with one more: as a product, and a sum of logarithms where it is tiny.

    `usual` and `outlying` are the exponentials of minus half the square, and of that over an outlier's width.
    """
    density = (1.0 - share) * usual + share / OUTLIER_FACTOR * outlying
    if density > _TINY:
        product *= density
    elif share > 0.0:
        total += math.log(share / OUTLIER_FACTOR) - 0.5 * square / (OUTLIER_FACTOR * OUTLIER_FACTOR)
    else:
        total -= 0.5 * square
    return _put_away(product, total)


@inner()
def _log_two_cases(table, event, low, high, run, cases, a, b):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings in two cases of the mixture, of the same scale or not.

    One logarithm for many readings, and exponentials that the cases share: this is what most of the time of a
    calibration goes into.
    """
    # Eight parameters, because packing them takes time in the innermost loop.
    scale_a, scale_b = cases[a, _SCALE], cases[b, _SCALE]
    share_a, share_b = cases[a, _SHARE], cases[b, _SHARE]
    product_a, product_b, product_sd = 1.0, 1.0, 1.0
    total_a, total_b, total_sd, n = 0.0, 0.0, 0.0, 0
    for j in range(table.shape[1]):
        if table[event, j, OBSERVED] == 0.0:
            continue
        residual, sd = _nearest(table, event, j, low[run, j], high[run, j], 0.0)
        n += 1
        product_sd, total_sd = _put_away(product_sd * sd, total_sd)
        square = (residual / (sd * scale_a)) ** 2
        usual = math.exp(-0.5 * square)
        outlying = math.exp(-0.5 * square / (OUTLIER_FACTOR * OUTLIER_FACTOR))
        product_a, total_a = _multiplied(product_a, total_a, usual, outlying, square, share_a)
        if scale_b != scale_a:
            square = (residual / (sd * scale_b)) ** 2
            usual = math.exp(-0.5 * square)
            outlying = math.exp(-0.5 * square / (OUTLIER_FACTOR * OUTLIER_FACTOR))
        product_b, total_b = _multiplied(product_b, total_b, usual, outlying, square, share_b)
    common = total_sd + math.log(product_sd) + n * _LOG_SQRT_2PI
    log_a = total_a + math.log(product_a) - n * cases[a, _LOG_SCALE] - common
    log_b = total_b + math.log(product_b) - n * cases[b, _LOG_SCALE] - common
    return log_a, log_b


@inner()
def _normal_sums(table, event, low, high, run):  # type: ignore[no-untyped-def]
    """Of the observed readings: squares in standard deviations, minus the log constants, and how many."""
    squares, product_sd, total_sd, n = 0.0, 1.0, 0.0, 0
    for j in range(table.shape[1]):
        if table[event, j, OBSERVED] > 0.0:
            residual, sd = _nearest(table, event, j, low[run, j], high[run, j], 0.0)
            squares += (residual / sd) ** 2
            product_sd, total_sd = _put_away(product_sd * sd, total_sd)
            n += 1
    return squares, total_sd + math.log(product_sd) + n * _LOG_SQRT_2PI, n


@inner()
def _log_independent(table, event, low, high, run, cases, degrees, bounds):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings, independent within each case of the mixture.

    `bounds` are those of the bounds in each case.
    """
    n_cases, outliers = cases.shape[0], False
    for case in range(n_cases):
        outliers |= cases[case, _SHARE] > 0.0
    squares, constants, n = 0.0, 0.0, 0
    if not outliers and degrees == 0.0:
        squares, constants, n = _normal_sums(table, event, low, high, run)
    most, total, second = -np.inf, 0.0, 0.0
    for case in range(n_cases):
        scale = cases[case, _SCALE]
        if degrees > 0.0:
            term = _log_student(table, event, low, high, run, scale, degrees)
        elif not outliers:
            term = -0.5 * squares / (scale * scale) - n * cases[case, _LOG_SCALE] - constants
        elif case % 2 == 0:
            other = min(case + 1, n_cases - 1)
            term, second = _log_two_cases(table, event, low, high, run, cases, case, other)
        else:
            term = second
        term += cases[case, _LOG_WEIGHT] + bounds[case]
        if term > most:
            total = total * math.exp(most - term) + 1.0
            most = term
        else:
            total += math.exp(term - most)
    return most + math.log(total)


@inner()
def _log_correlated(table, event, predictions, run, common):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings with an error common to the velocities."""
    n_velocities, n, squares, total = 0, 0, 0.0, 0.0
    product_sd, total_sd = 1.0, 0.0
    for j in range(table.shape[1]):
        if table[event, j, OBSERVED] == 0.0:
            continue
        sd = reading_sd(table, event, j, predictions[run, j])
        z = (table[event, j, VALUE] - predictions[run, j]) / sd
        own = 1.0 - common if table[event, j, VELOCITY] > 0.0 else 1.0
        product_sd, total_sd = _put_away(product_sd * sd, total_sd)
        squares += z * z / own
        n += 1
        if table[event, j, VELOCITY] > 0.0:
            n_velocities += 1
            total += z / own
    log_sd = total_sd + math.log(product_sd) + 0.5 * n_velocities * math.log(1.0 - common)
    inflation = 1.0 + common * n_velocities / (1.0 - common)
    squares -= common * total * total / inflation
    return -0.5 * squares - log_sd - 0.5 * math.log(inflation) - n * _LOG_SQRT_2PI


@inner()
def _bound_correlated(table, event, low, high, run, common):  # type: ignore[no-untyped-def]
    """Largest log likelihood for predictions between two values, over a grid of the common error."""
    most = -np.inf
    for step in range(-_COMMON_STEPS, _COMMON_STEPS + 1):
        c = step * _COMMON_STEP
        term = -0.5 * c * c
        for j in range(table.shape[1]):
            if table[event, j, OBSERVED] > 0.0:
                own = 1.0 - common if table[event, j, VELOCITY] > 0.0 else 1.0
                residual, sd = _nearest(table, event, j, low[run, j], high[run, j], math.sqrt(common) * c)
                wide = sd * math.sqrt(own)
                term -= 0.5 * (residual / wide) ** 2 + math.log(wide) + _LOG_SQRT_2PI
        most = max(most, term)
    return most


@compiled()
def _log_between(events, low, high, exact, readings, errors):  # type: ignore[no-untyped-def]
    """Log likelihood of what lies `exact` at `low`; without that, its bound for anything up to `high`.

    One function for both: with two most of this module would be compiled twice.
    """
    result = np.empty(events.size)
    table, cases, degrees, common = tabled(readings), _cases_of(errors), errors.degrees, errors.common
    reached, not_reached, place_sd = readings.reached, readings.not_reached, readings.place_sd
    last, bounds = low.shape[1] - 1, np.zeros(cases.shape[0])
    bounded = bounded_events(table)
    for run in range(events.size):
        event = events[run]
        best = 0.5 * (reached[event] + not_reached[event])
        if reached[event] == -np.inf and not_reached[event] == np.inf:
            best = low[run, last]
        stop = min(max(best, low[run, last]), high[run, last])
        if bounded[event]:
            fill_log_bounds(table, event, low, high, run, cases, degrees, bounds)
        else:
            bounds[:] = 0.0
        if common == 0.0:
            found = _log_independent(table, event, low, high, run, cases, degrees, bounds)
        elif exact:
            found = _log_correlated(table, event, low, run, common) + bounds[0]
        else:
            found = _bound_correlated(table, event, low, high, run, common) + bounds[0]
        result[run] = found + _log_stop(stop, reached[event], not_reached[event], place_sd)
    return result


def log_likelihoods(
    events: IntArray, predictions: FloatArray, readings: EventReadings, errors: Errors
) -> FloatArray:
    """Log likelihood of each event's readings given what its fronts do, (n,).

    Parameters
    ----------
    events : (n,) integer array
    predictions : (n, n_sensors + 1) array
        Readings of the fronts [m/s or m], spans up to the stop, and last their runouts [m].
    readings : EventReadings
    errors : Errors
    """
    fronts = np.ascontiguousarray(predictions)
    result: FloatArray = _log_between(events, fronts, fronts, True, readings, errors)
    return result


def log_likelihood_bounds(
    events: IntArray, low: FloatArray, high: FloatArray, readings: EventReadings, errors: Errors
) -> FloatArray:
    """Upper bounds of `log_likelihoods` over all predictions between two, each by itself."""
    result: FloatArray = _log_between(events, low, high, False, readings, errors)
    return result


def assess(
    events: IntArray,
    predictions: FloatArray,
    readings: EventReadings,
    errors: Errors,
    envelope: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """What the likelihood may be in each box, and how its readings change along each axis.

    Parameters
    ----------
    predictions : (n_boxes, n_corners, n_sensors + 1) array
        Bit j of a corner's number is its side on axis j.
    envelope : (n_boxes, 1 + n_corners) array
        Its logarithm, at most within the box and at the corners; the likelihoods are times the envelope.

    Returns
    -------
    change : (n_boxes, n_axes) array
    bound, top, mean : (n_boxes,) arrays
        Of the log likelihood: an upper bound, the best corner, and the logarithm of the corners' mean.
    """
    # Nine parameters: four of them are arrays that it fills.
    n_boxes, n_corners, n_columns = predictions.shape
    low, high = predictions.min(axis=1), predictions.max(axis=1)
    bound = envelope[:, 0] + log_likelihood_bounds(events, low, high, readings, errors)
    every = predictions.reshape(n_boxes * n_corners, n_columns)
    corners = log_likelihoods(np.repeat(events, n_corners), every, readings, errors)
    corners = corners.reshape(n_boxes, n_corners) + envelope[:, 1:]
    top = corners.max(axis=1)
    mean = top + np.log(np.exp(corners - top[:, None]).mean(axis=1))
    change = np.empty((n_boxes, n_corners.bit_length() - 1))
    _fill_changes(events, predictions, low, high, readings, change)
    return change, bound, top, mean


@compiled()
def _fill_changes(events, predictions, low, high, readings, change):  # type: ignore[no-untyped-def]
    """Largest change of a box's readings along each axis, in standard deviations of their errors."""
    n_boxes, n_corners, n_columns = predictions.shape
    table, place_sd = tabled(readings), readings.place_sd
    reached, not_reached = readings.reached, readings.not_reached
    sd, corners = np.empty(n_columns), np.empty((n_corners, n_columns))
    for box in range(n_boxes):
        event = events[box]
        uses_stop = reached[event] > -np.inf or not_reached[event] < np.inf
        sd[:] = np.inf
        corners[:] = predictions[box]
        for j in range(n_columns - 1):
            if table[event, j, OBSERVED] > 0.0:
                _, sd[j] = _nearest(table, event, j, low[box, j], high[box, j], 0.0)
            elif is_bounded(table, event, j):
                sd[j] = reading_sd(table, event, j, low[box, j])
                flatten(table, event, j, sd[j], corners)
        if uses_stop:
            sd[n_columns - 1] = place_sd
        for axis in range(change.shape[1]):
            largest = 0.0
            for corner in range(n_corners):
                other = corner | (1 << axis)
                if other != corner:
                    square = 0.0
                    for j in range(n_columns):
                        square += ((corners[other, j] - corners[corner, j]) / sd[j]) ** 2
                    largest = max(largest, square)
            change[box, axis] = math.sqrt(largest)
