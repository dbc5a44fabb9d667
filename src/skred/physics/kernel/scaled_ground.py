"""The ground as the equation of motion uses it, times the cells' lengths: the same for all runs."""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.columns import GRAVITY

DRIVE, WEIGHT, BEND, DOUBLE = 0, 1, 2, 3
"""Rows of the scaled ground: 2 g sin(phi), 2 g cos(phi), 2 kappa and 2, times the cell's length."""


@inner()
def scale_ground(edge, ground):  # type: ignore[no-untyped-def]
    """What the equation of motion makes of the ground, times length: the same for all runs."""
    scaled = np.empty((4, ground.shape[1]))
    for i in range(ground.shape[1]):
        double = 2.0 * (edge[i + 1] - edge[i])
        scaled[DRIVE, i] = double * GRAVITY * ground[0, i]
        scaled[WEIGHT, i] = double * GRAVITY * ground[1, i]
        scaled[BEND, i] = double * ground[2, i]
        scaled[DOUBLE, i] = double
    return scaled
