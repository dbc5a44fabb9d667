"""From a strength under the widest scale of its prior alone to one under all of them: evidence, moments."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import log_ndtr
from scipy.stats import truncnorm

from skred.arrays import FloatArray
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.strength_prior import SCALES


def log_over_scales(mean: float, variance: float, placed: PlacedMechanism) -> float:
    """What all scales, and one side of nil or both, add to the log evidence under the widest normal prior.

    Parameters
    ----------
    mean, variance : float
        Of the strength under the widest scale alone, at either side of nil.
    placed : PlacedMechanism
        Whose strength it is.
    """
    log_each, _, _ = _each(mean, variance, placed)
    return float(np.logaddexp.reduce(log_each)) - math.log(len(SCALES))


def moments_over_scales(mean: float, variance: float, placed: PlacedMechanism) -> tuple[float, float]:
    """Mean and standard deviation of the strength under its whole prior; parameters as `log_over_scales`."""
    log_each, means, variances = _each(mean, variance, placed)
    if not placed.added.either_sign:
        sds = np.sqrt(variances)
        cut = truncnorm.stats(-means / sds, np.inf, means, sds, moments="mv")
        means, variances = (np.asarray(one) for one in cut)
    shares = np.exp(log_each - np.logaddexp.reduce(log_each))
    middle = float(shares @ means)
    return middle, math.sqrt(float(shares @ (variances + (means - middle) ** 2)))


def _each(mean: float, variance: float, placed: PlacedMechanism) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What each scale adds to the log evidence, and mean and variance under it at either side of nil."""
    scales = placed.scale * np.array(SCALES)
    sharper = scales**-2.0 - placed.widest**-2.0
    room = 1.0 + variance * sharper
    means, variances = mean / room, variance / room
    log_each = np.log(placed.widest / scales) - 0.5 * np.log(room) - 0.5 * mean**2 * sharper / room
    if not placed.added.either_sign:
        log_each += math.log(2.0) + log_ndtr(means / np.sqrt(variances))
    return log_each, means, variances
