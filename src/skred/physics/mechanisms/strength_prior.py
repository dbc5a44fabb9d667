"""The prior of an added strength, in scales of its mechanism: normal of three sizes, or the half above nil.

A force that a law leaves out is not known within an order of magnitude beforehand. One scale alone would make
strong ones all but impossible: six scales cost 18 nats, here less than five.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from skred.arrays import FloatArray

SCALES = (1.0 / 3.0, 1.0, 3.0)
"""Scales of the prior of an added strength in its mechanism's own, and of a discrepancy in its typical
amplitude, all of equal prior probability. With one alone strong ones are all but impossible."""
MEDIAN = 0.5735
"""Median of its size, in scales of the mechanism."""
KIND = {
    False: "half-normal, of a third, one or three scales",
    True: "normal, of a third, one or three scales",
}
"""What the prior is called, by whether either sign may be."""


def log_prior_density(
    strengths: FloatArray, scale: float, *, either_sign: bool, scales: Sequence[float] = SCALES
) -> FloatArray:
    """Log density of an added strength's prior.

    Parameters
    ----------
    strengths : (n,) array
        Not negative unless `either_sign`.
    scale : float
        The mechanism's own, in the strength's unit.
    scales : sequence of float
        Of the prior, in that one.
    """
    each = scale * np.asarray(scales)
    sides = 0.0 if either_sign else math.log(2.0)
    height = -0.5 * (strengths[:, None] / each) ** 2 - np.log(each)
    total = np.logaddexp.reduce(height, axis=-1) - math.log(len(each)) - 0.5 * math.log(2.0 * math.pi)
    return np.asarray(total + sides)
