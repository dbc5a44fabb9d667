"""Readings of which only bounds are known: the probability of a side or an interval, in numba.

A bound is softened by the reading's own error: P(least < reading < most), where the reading scatters about
the prediction as the error model says. Logarithms are taken in the tails themselves, so that they stay right
where the probability is below any number.
"""

from __future__ import annotations

import math

import numpy as np

from skred.inference.error_model import OUTLIER_FACTOR
from skred.inference.reading_table import LEAST, MOST, is_bounded, reading_sd
from skred.parallel.compile_cache import inner

_SQRT_HALF = math.sqrt(0.5)
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)
_ASYMPTOTIC = 20.0
"""Standard deviations beyond which a normal tail is taken from its asymptotic series: to 1e-11 of its log."""
_FAR = 1e4
"""Standard deviations beyond which the curvature of a normal tail is 1, and its terms cancel."""
_LOG_STUDENT = math.log(3.0 / 8.0)
"""Log density of Student's t with 4 degrees of freedom at 0."""


@inner()
def log_lower(x, student):  # type: ignore[no-untyped-def]
    """Log probability that a standard variable lies below x: normal, or Student's t with 4 degrees."""
    if x == np.inf:
        return 0.0
    if x == -np.inf:
        return -np.inf
    if student:
        # With y = |x| / sqrt(4 + x^2) the tail is (1 - y)^2 (2 + y) / 4, and 1 - y does not cancel so:
        root = math.sqrt(4.0 + x * x)
        short = 4.0 / (root * (root + abs(x)))
        log_tail = 2.0 * math.log(short) + math.log(0.75 - 0.25 * short)
        return log_tail if x < 0.0 else math.log1p(-math.exp(log_tail))
    if x > 0.0:
        return math.log1p(-0.5 * math.erfc(x * _SQRT_HALF))
    if x > -_ASYMPTOTIC:
        return math.log(0.5 * math.erfc(-x * _SQRT_HALF))
    r = 1.0 / (x * x)
    series = -r * (1.0 - r * (3.0 - r * (15.0 - r * (105.0 - r * 945.0))))
    return -0.5 * x * x - math.log(-x) - _LOG_SQRT_2PI + math.log1p(series)


@inner()
def log_density(x, student):  # type: ignore[no-untyped-def]
    """Log density of the same variable; minus infinity at infinity."""
    if abs(x) == np.inf:
        return -np.inf
    return _LOG_STUDENT - 2.5 * math.log1p(0.25 * x * x) if student else -0.5 * x * x - _LOG_SQRT_2PI


@inner()
def log_inside(low, high, student):  # type: ignore[no-untyped-def]
    """Log probability that it lies between two numbers, from the tail in which nothing cancels."""
    if low == -np.inf:
        return log_lower(high, student)
    if high == np.inf:
        return log_lower(-low, student)
    if low > 0.0:
        low, high = -high, -low
    larger, smaller = log_lower(high, student), log_lower(low, student)
    width = high - low
    if larger - smaller < 1e-6:
        # Narrower than the tails can tell: density times width.
        return log_density(0.5 * (low + high), student) + math.log(width)
    return larger + math.log1p(-math.exp(smaller - larger))


@inner()
def log_bound(low, high, share, student):  # type: ignore[no-untyped-def]
    """Log probability of an interval where a share of the errors is `OUTLIER_FACTOR` times as wide."""
    usual = log_inside(low, high, student)
    if share == 0.0:
        return usual
    outlying = math.log(share) + log_inside(low / OUTLIER_FACTOR, high / OUTLIER_FACTOR, student)
    usual += math.log1p(-share)
    most = max(usual, outlying)
    if most == -np.inf:
        return most
    return most + math.log(math.exp(usual - most) + math.exp(outlying - most))


@inner()
def _slopes_inside(low, high, d_log_sd, student):  # type: ignore[no-untyped-def]
    """Slope and curvature of `log_inside` by the prediction, in standard deviations.

    `d_log_sd` is the derivative of the log of the standard deviation by the prediction in them. The curvature
    leaves it out.
    """
    log_p = log_inside(low, high, student)
    slope, plain, bend = 0.0, 0.0, 0.0
    for end, sign in ((low, 1.0), (high, -1.0)):
        if abs(end) == np.inf:
            continue
        hazard = sign * math.exp(min(log_density(end, student) - log_p, 700.0))
        slope += hazard * (1.0 + end * d_log_sd)
        plain += hazard
        bend += hazard * (5.0 * end / (4.0 + end * end) if student else end)
    if not student and (low > _FAR or high < -_FAR):
        return slope, 1.0
    return slope, min(max(plain * plain - bend, 0.0), 1.0)


@inner()
def bound_slopes(low, high, share, d_log_sd, student):  # type: ignore[no-untyped-def]
    """Slope and curvature of `log_bound` by the prediction, in standard deviations.

    The curvature is that of the two kinds of errors by how probable each is, without what is between them:
    positive, as steps of Gauss and Newton want it.
    """
    slope, curvature = _slopes_inside(low, high, d_log_sd, student)
    if share == 0.0:
        return slope, curvature
    wide_low, wide_high = low / OUTLIER_FACTOR, high / OUTLIER_FACTOR
    wide = _slopes_inside(wide_low, wide_high, d_log_sd * OUTLIER_FACTOR, student)
    odds = log_inside(wide_low, wide_high, student) - log_inside(low, high, student)
    odds += math.log(share) - math.log1p(-share)
    outlying = 1.0 / (1.0 + math.exp(min(-odds, 700.0)))
    slope = (1.0 - outlying) * slope + outlying * wide[0] / OUTLIER_FACTOR
    curvature = (1.0 - outlying) * curvature + outlying * wide[1] / (OUTLIER_FACTOR * OUTLIER_FACTOR)
    return slope, curvature


@inner()
def fill_log_bounds(table, event, low, high, run, cases, degrees, result):  # type: ignore[no-untyped-def]
    """Log probability of all bounds of an event in each case of the mixture, for the best predictions.

    A case is a row of `cases`: first the factor on all errors, then the share of outliers.

    Between two predictions the best one for a lower bound is the higher, for an upper bound the lower; an
    interval is at most as probable as each of its bounds.
    """
    result[:] = 0.0
    for j in range(table.shape[1]):
        if not is_bounded(table, event, j):
            continue
        least, most, bottom, top = table[event, j, LEAST], table[event, j, MOST], low[run, j], high[run, j]
        at_bottom, at_top = reading_sd(table, event, j, bottom), reading_sd(table, event, j, top)
        for case in range(cases.shape[0]):
            scale, share = cases[case, 0], cases[case, 1]
            below, above = (least - top) / (at_top * scale), (most - bottom) / (at_bottom * scale)
            if bottom == top:
                result[case] += log_bound(below, above, share, degrees > 0.0)
            else:
                lower = log_bound(below, np.inf, share, degrees > 0.0)
                result[case] += min(lower, log_bound(-np.inf, above, share, degrees > 0.0))
