"""Tangents of a front with terms in U over cells in which nothing happens; else see `cell_tangents`."""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.cell import (
    FRICTION,
    LINEAR,
    QUADRATIC,
    WEAKENING,
    mean_speed,
    mean_speed_slope,
    psi,
)
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.scaled_ground import BEND, DOUBLE


@inner()
def fill_speed_changes(  # type: ignore[no-untyped-def]
    scaled, ground, table, u_c, keep, v, by_source, by_decay, mean, soften, carry
):
    """Let the tangents' ingredients know of the terms in U, in cells where nothing happens.

    Over such a cell v1 = keep v0 + ... + P S(m), with P per source, S the terms in U and m the mean speed,
    which depends on both ends. With everything else frozen v changes by ``soften`` times what it would change
    by without, and ``carry`` takes the place of keep; by_decay gets the source's part that S is.
    """
    for i in range(carry.size):
        mean[i], soften[i], carry[i] = 0.0, 1.0, keep[i]
        if not (v[i] > 0.0 and v[i + 1] > 0.0):
            continue
        u0, u1 = np.sqrt(v[i]), np.sqrt(v[i + 1])
        m = mean_speed(u0, u1)
        relative = 1.0 / (1.0 + m / u_c)
        weakening = table[WEAKENING, i] * GRAVITY * ground[1, i] * relative
        x = scaled[DOUBLE, i] * table[QUADRATIC, i] + scaled[BEND, i] * table[FRICTION, i]
        by_decay[i] += scaled[DOUBLE, i] * (table[LINEAR, i] * m + weakening) * psi(x)
        by_mean = -scaled[DOUBLE, i] * by_source[i] * (table[LINEAR, i] - weakening * relative / u_c)
        mean[i] = m
        soften[i] = 1.0 / (1.0 - by_mean * mean_speed_slope(u1, u0) / (2.0 * u1))
        carry[i] = soften[i] * (keep[i] + by_mean * mean_speed_slope(u0, u1) / (2.0 * u0))
