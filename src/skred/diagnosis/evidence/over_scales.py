"""From a strength under the widest scale of its prior alone to one under all of them: evidence, moments."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.strength_prior import SCALES


class OverScales(NamedTuple):
    """What the other scales change.

    Attributes
    ----------
    log_factor : float
        To be added to the log evidence under the widest normal prior.
    mean, sd : float
        Of the strength.
    """

    log_factor: float
    mean: float
    sd: float


def over_scales(mean: float, variance: float, placed: PlacedMechanism) -> OverScales:
    """Evidence and moments of a strength under its whole prior, of all scales and one side of nil or both.

    Parameters
    ----------
    mean, variance : float
        Of the strength under the widest scale alone, at either side of nil.
    placed : PlacedMechanism
        Whose strength it is.
    """
    scales = placed.scale * np.array(SCALES)
    sharper = scales**-2.0 - placed.widest**-2.0
    room = 1.0 + variance * sharper
    means, variances = mean / room, variance / room
    log_each = np.log(placed.widest / scales) - 0.5 * np.log(room) - 0.5 * mean**2 * sharper / room
    if not placed.added.either_sign:
        log_each += math.log(2.0) + log_ndtr(means / np.sqrt(variances))
    total = float(np.logaddexp.reduce(log_each))
    shares = np.exp(log_each - total)
    middle = float(shares @ means)
    sd = math.sqrt(float(shares @ (variances + (means - middle) ** 2)))
    return OverScales(total - math.log(len(scales)), middle, sd)
