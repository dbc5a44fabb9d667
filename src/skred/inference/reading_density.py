"""Densities of one event's readings given a front, and their bounds, in numba."""

from __future__ import annotations

import math

import numpy as np

from skred.inference.compiled import compiled

OUTLIER_FACTOR = 6.0
"""How much wider than its stated error an outlying reading scatters."""
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)
_SQRT_HALF = math.sqrt(0.5)
_LEAST = 1e-300
_TINY, _SMALL = 1e-30, 1e-200
"""Densities below the first are taken by their logarithm; products below the second are put away."""
_COMMON_STEPS, _COMMON_STEP = 28, 0.5


@compiled()
def reading_sd(event, sensor, prediction, readings):  # type: ignore[no-untyped-def]
    """Standard deviation of a reading [m/s or m]: its own, else from the prediction."""
    if readings.stated_sd[event, sensor] > 0.0:
        return readings.stated_sd[event, sensor]
    return math.hypot(readings.relative_sd[sensor] * prediction, readings.absolute_sd[sensor])


@compiled()
def _log_stop(stop, reached, not_reached, place_sd):  # type: ignore[no-untyped-def]
    """Log probability that a front that stops at `stop` is seen to stop between two places."""
    above = (reached - stop) / place_sd * _SQRT_HALF
    below = (not_reached - stop) / place_sd * _SQRT_HALF
    if above > 0.0:  # from the upper tail, where the difference does not cancel
        probability = 0.5 * (math.erfc(above) - math.erfc(below))
    else:
        probability = 0.5 * (math.erfc(-below) - math.erfc(-above))
    return math.log(max(probability, _LEAST))


@compiled()
def _unshifted(value, shift, event, sensor, readings):  # type: ignore[no-untyped-def]
    """The prediction whose reading, `shift` standard deviations higher, is the value.

    The standard deviation is the prediction's own, which makes it the root of a quadratic equation.
    """
    stated = readings.stated_sd[event, sensor]
    if stated > 0.0:
        return value - shift * stated
    absolute, relative = shift * readings.absolute_sd[sensor], shift * readings.relative_sd[sensor]
    inside = absolute * absolute * (1.0 - relative * relative) + relative * relative * value * value
    root = math.copysign(math.sqrt(max(inside, 0.0)), shift)
    below = value + root
    if abs(below) > 1e-9 * abs(value) + 1e-12:
        return (value * value - absolute * absolute) / below
    return value - shift * reading_sd(event, sensor, value, readings)


@compiled()
def _nearest(event, sensor, low, high, shift, readings):  # type: ignore[no-untyped-def]
    """The residual of smallest size, and its standard deviation, for predictions between two values.

    `shift` is an error common to the velocities, in standard deviations of theirs.
    """
    value = readings.values[event, sensor]
    if shift == 0.0 or not readings.is_velocity[sensor]:
        shift = 0.0
        nearest = value
    else:
        nearest = _unshifted(value, shift, event, sensor, readings)
    prediction = min(max(nearest, low), high)
    sd = reading_sd(event, sensor, prediction, readings)
    return value - prediction - shift * sd, sd


@compiled()
def _put_away(product, total):  # type: ignore[no-untyped-def]
    """A product and a sum of logarithms: the product moved into the sum where it gets out of range."""
    if _SMALL < product < 1.0 / _SMALL:
        return product, total
    return 1.0, total + math.log(product)


@compiled()
def _log_student(event, low, high, readings, errors, case):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings under Student's t, in one case of the mixture."""
    degrees, scale, n = errors.degrees, errors.scales[case], 0
    product_sd, product_tail, total_sd, total_tail = 1.0, 1.0, 0.0, 0.0
    for j in range(readings.values.shape[1]):
        if readings.observed[event, j]:
            residual, sd = _nearest(event, j, low[j], high[j], 0.0, readings)
            wide = sd * scale
            product_sd, total_sd = _put_away(product_sd * wide, total_sd)
            tail = 1.0 + (residual / wide) ** 2 / degrees
            product_tail, total_tail = _put_away(product_tail * tail, total_tail)
            n += 1
    constant = math.lgamma(0.5 * (degrees + 1.0)) - math.lgamma(0.5 * degrees)
    constant -= 0.5 * math.log(degrees * math.pi)
    log_sd, log_tail = total_sd + math.log(product_sd), total_tail + math.log(product_tail)
    return n * constant - log_sd - 0.5 * (degrees + 1.0) * log_tail


@compiled()
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


@compiled()
def _log_two_cases(event, low, high, readings, errors, a, b):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings in two cases of the mixture, of the same scale or not.

    One logarithm for many readings, and exponentials that the cases share: this is what most of the time of a
    calibration goes into.
    """
    scale_a, scale_b, share_a, share_b = (
        errors.scales[a],
        errors.scales[b],
        errors.shares[a],
        errors.shares[b],
    )
    product_a, product_b, product_sd = 1.0, 1.0, 1.0
    total_a, total_b, total_sd, n = 0.0, 0.0, 0.0, 0
    for j in range(readings.values.shape[1]):
        if not readings.observed[event, j]:
            continue
        residual, sd = _nearest(event, j, low[j], high[j], 0.0, readings)
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
    log_a = total_a + math.log(product_a) - n * errors.log_scales[a] - common
    log_b = total_b + math.log(product_b) - n * errors.log_scales[b] - common
    return log_a, log_b


@compiled()
def _normal_sums(event, low, high, readings):  # type: ignore[no-untyped-def]
    """Of the observed readings: squares in standard deviations, minus the log constants, and how many."""
    squares, product_sd, total_sd, n = 0.0, 1.0, 0.0, 0
    for j in range(readings.values.shape[1]):
        if readings.observed[event, j]:
            residual, sd = _nearest(event, j, low[j], high[j], 0.0, readings)
            squares += (residual / sd) ** 2
            product_sd, total_sd = _put_away(product_sd * sd, total_sd)
            n += 1
    return squares, total_sd + math.log(product_sd) + n * _LOG_SQRT_2PI, n


@compiled()
def _log_independent(event, low, high, readings, errors):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings, independent within each case of the mixture."""
    n_cases, outliers = errors.weights.size, False
    for case in range(n_cases):
        outliers |= errors.shares[case] > 0.0
    squares, constants, n = 0.0, 0.0, 0
    if not outliers and errors.degrees == 0.0:
        squares, constants, n = _normal_sums(event, low, high, readings)
    most, total, second = -np.inf, 0.0, 0.0
    for case in range(n_cases):
        if errors.degrees > 0.0:
            term = _log_student(event, low, high, readings, errors, case)
        elif not outliers:
            scale = errors.scales[case]
            term = -0.5 * squares / (scale * scale) - n * errors.log_scales[case] - constants
        elif case % 2 == 0:
            other = min(case + 1, n_cases - 1)
            term, second = _log_two_cases(event, low, high, readings, errors, case, other)
        else:
            term = second
        term += errors.log_weights[case]
        if term > most:
            total = total * math.exp(most - term) + 1.0
            most = term
        else:
            total += math.exp(term - most)
    return most + math.log(total)


@compiled()
def _log_correlated(event, prediction, readings, common):  # type: ignore[no-untyped-def]
    """Log likelihood of the observed readings with an error common to the velocities."""
    n_velocities, n, squares, total = 0, 0, 0.0, 0.0
    product_sd, total_sd = 1.0, 0.0
    for j in range(readings.values.shape[1]):
        if not readings.observed[event, j]:
            continue
        sd = reading_sd(event, j, prediction[j], readings)
        z = (readings.values[event, j] - prediction[j]) / sd
        own = 1.0 - common if readings.is_velocity[j] else 1.0
        product_sd, total_sd = _put_away(product_sd * sd, total_sd)
        squares += z * z / own
        n += 1
        if readings.is_velocity[j]:
            n_velocities += 1
            total += z / own
    log_sd = total_sd + math.log(product_sd) + 0.5 * n_velocities * math.log(1.0 - common)
    inflation = 1.0 + common * n_velocities / (1.0 - common)
    squares -= common * total * total / inflation
    return -0.5 * squares - log_sd - 0.5 * math.log(inflation) - n * _LOG_SQRT_2PI


@compiled()
def _bound_correlated(event, low, high, readings, common):  # type: ignore[no-untyped-def]
    """Largest log likelihood for predictions between two values, over a grid of the common error."""
    most = -np.inf
    for step in range(-_COMMON_STEPS, _COMMON_STEPS + 1):
        c = step * _COMMON_STEP
        term = -0.5 * c * c
        for j in range(readings.values.shape[1]):
            if readings.observed[event, j]:
                own = 1.0 - common if readings.is_velocity[j] else 1.0
                residual, sd = _nearest(event, j, low[j], high[j], math.sqrt(common) * c, readings)
                wide = sd * math.sqrt(own)
                term -= 0.5 * (residual / wide) ** 2 + math.log(wide) + _LOG_SQRT_2PI
        most = max(most, term)
    return most


@compiled()
def log_likelihood(event, prediction, readings, errors):  # type: ignore[no-untyped-def]
    """Log likelihood of an event's readings given what its front does.

    Parameters
    ----------
    event : int
    prediction : (n_sensors + 1,) array
        Readings of the front [m/s or m], spans up to the stop, and last its runout [m].
    readings : EventReadings
    errors : Errors
    """
    stop = prediction[prediction.size - 1]
    at_stop = _log_stop(stop, readings.reached[event], readings.not_reached[event], readings.place_sd)
    if errors.common > 0.0:
        return at_stop + _log_correlated(event, prediction, readings, errors.common)
    return at_stop + _log_independent(event, prediction, prediction, readings, errors)


@compiled()
def log_likelihood_bound(event, low, high, readings, errors):  # type: ignore[no-untyped-def]
    """Upper bound of `log_likelihood` over all predictions between two, each by itself."""
    last = low.size - 1
    reached, not_reached = readings.reached[event], readings.not_reached[event]
    best = 0.5 * (reached + not_reached)
    if reached == -np.inf and not_reached == np.inf:
        best = low[last]
    stop = min(max(best, low[last]), high[last])
    at_stop = _log_stop(stop, reached, not_reached, readings.place_sd)
    if errors.common > 0.0:
        return at_stop + _bound_correlated(event, low, high, readings, errors.common)
    return at_stop + _log_independent(event, low, high, readings, errors)


@compiled()
def log_likelihoods(events, predictions, readings, errors):  # type: ignore[no-untyped-def]
    """Log likelihood of each event for each of its runs, (n,) and (n, n_sensors + 1) to (n,)."""
    result = np.empty(events.size)
    for i in range(events.size):
        result[i] = log_likelihood(events[i], predictions[i], readings, errors)
    return result


@compiled()
def assess(events, predictions, readings, errors, envelope, change, bound, top, mean):  # type: ignore[no-untyped-def]
    """Fill, for each box, the change of its readings along each axis, and what its likelihood may be.

    That is its bound, its best corner and the corners' mean, all as logarithms and times the envelope.
    `envelope` is (n_boxes, 1 + n_corners): its logarithm, at most within the box and at the corners.

    `predictions` is (n_boxes, n_corners, n_sensors + 1); bit j of a corner's number is its side on axis j.
    """
    n_boxes, n_corners, n_columns = predictions.shape
    low, high, sd = np.empty(n_columns), np.empty(n_columns), np.empty(n_columns)
    corners = np.empty(n_corners)
    for box in range(n_boxes):
        event = events[box]
        uses_stop = readings.reached[event] > -np.inf or readings.not_reached[event] < np.inf
        for j in range(n_columns):
            least, most = predictions[box, 0, j], predictions[box, 0, j]
            for corner in range(1, n_corners):
                least = min(least, predictions[box, corner, j])
                most = max(most, predictions[box, corner, j])
            low[j], high[j], sd[j] = least, most, np.inf
            if j == n_columns - 1:
                if uses_stop:
                    sd[j] = readings.place_sd
            elif readings.observed[event, j]:
                sd[j] = reading_sd(event, j, min(max(readings.values[event, j], least), most), readings)
        bound[box] = envelope[box, 0] + log_likelihood_bound(event, low, high, readings, errors)
        for corner in range(n_corners):
            corners[corner] = log_likelihood(event, predictions[box, corner], readings, errors)
            corners[corner] += envelope[box, 1 + corner]
        top[box] = corners.max()
        mean[box] = top[box] + math.log(np.exp(corners - top[box]).mean())
        for axis in range(change.shape[1]):
            largest = 0.0
            for corner in range(n_corners):
                other = corner | (1 << axis)
                if other != corner:
                    square = 0.0
                    for j in range(n_columns):
                        square += ((predictions[box, other, j] - predictions[box, corner, j]) / sd[j]) ** 2
                    largest = max(largest, square)
            change[box, axis] = math.sqrt(largest)
