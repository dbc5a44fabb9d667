"""The march with terms in U: cell after cell where nothing happens, without a closed form.

In each cell the terms in U are frozen at the mean speed of the stretch (see `cell.end_speed`), and the
speed at its end is solved for: here by Newton's method from what the cells before let expect, two steps as
a rule. What is not quickly solved is left to `cell.cross`: the same equation, its solution enclosed.
"""

from __future__ import annotations

import numpy as np

from skred.physics.cell import (
    FRICTION,
    LINEAR,
    QUADRATIC,
    SERIES_LIMIT,
    WEAKENING,
    mean_speed,
    mean_speed_slope,
    phi1,
    phi1_series,
    psi,
)
from skred.physics.columns import GRAVITY
from skred.physics.compiled import compiled
from skred.physics.scaled_ground import BEND, DOUBLE

_STEPS, _NEAR = 6, 5e-8
_LEAST_SHARE = 0.5
"""Share of the speed below which a cell would slow a front so much that the first guess is no guess."""


@compiled()
def fill_sources(scaled, table, per_source):  # type: ignore[no-untyped-def]
    """Change of v over each whole cell per unit of source: its length times phi1."""
    for i in range(per_source.size):
        x = scaled[DOUBLE, i] * table[QUADRATIC, i] + scaled[BEND, i] * table[FRICTION, i]
        p = phi1_series(x) if abs(x) <= SERIES_LIMIT else phi1(x)
        per_source[i] = 0.5 * scaled[DOUBLE, i] * p


@compiled(fastmath={"contract"})
def recur_with_speed(first, ground, table, keep, gain, per_source, u_c, limits, v):  # type: ignore[no-untyped-def]
    """Fill v from edge `first` on for as long as nothing happens; returns the edge reached."""
    v0 = v[first]
    if not 0.0 < v0 <= limits[first]:
        return first
    i, n_cells, u0, per_scale = first, keep.size, np.sqrt(v0), 1.0 / u_c
    gained, before = 0.0, 0.0
    while i < n_cells:
        carried = keep[i] * v0 + gain[i]
        linear = -2.0 * per_source[i] * table[LINEAR, i]
        weakening = -2.0 * per_source[i] * table[WEAKENING, i] * GRAVITY * ground[1, i]
        # As if the speed went on as it did in the two cells before.
        u1, solved = u0 + gained + (gained - before), False
        if not u1 > _LEAST_SHARE * u0:
            break
        for _ in range(_STEPS):
            per_total = 1.0 / (1.5 * (u0 + u1))
            mean = (v0 + u0 * u1 + u1 * u1) * per_total
            relative = 1.0 / (1.0 + mean * per_scale) if weakening != 0.0 else 0.0
            excess = carried + linear * mean + weakening * relative - u1 * u1
            by_mean = linear - weakening * relative * relative * per_scale
            left = 2.0 * u1 - by_mean * (2.0 * u1 + u0 - 1.5 * mean) * per_total
            if not left > u1:  # close to where there are two solutions, or none
                break
            u1 += excess / left
            # What this step leaves goes with the square of the excess: it is below rounding.
            if abs(excess) <= _NEAR * v0:
                solved = True
                break
        if not (solved and u1 > _LEAST_SHARE * u0 and u1 * u1 <= limits[i + 1]):
            break
        v0 = u1 * u1
        v[i + 1] = v0
        before, gained, u0 = gained, u1 - u0, u1
        i += 1
    return i


@compiled()
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
