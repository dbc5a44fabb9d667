"""Tangents of a front through (part of) one cell: what `cell.cross` does, differentiated.

They are carried at fixed place, with the shift of the place beside them where something moves: the
release, a switch of the normal force, the stop.
"""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.cell import (
    CONSTANT,
    COVERED,
    FRICTION,
    LINEAR,
    QUADRATIC,
    STOPPED,
    SWITCHED,
    WEAKENING,
    coefficients,
    end_of_phase,
    end_speed,
    linear_part,
    mean_speed,
    mean_speed_slope,
    phi1,
    psi,
    speed_part_slope,
    step_v,
    switching_threshold,
)
from skred.physics.kernel.columns import GRAVITY


@inner()
def _source_change(column, profile, cell, u, on):  # type: ignore[no-untyped-def]
    """Change of the part of dv/ds that does not grow with v, per unit of one strength."""
    if column == CONSTANT:
        return -2.0 * profile
    if column == LINEAR:
        return -2.0 * profile * u
    if column == FRICTION and on:
        return -2.0 * profile * GRAVITY * cell.cosine
    if column == WEAKENING:
        return -2.0 * profile * GRAVITY * cell.cosine / (1.0 + u / cell.weakening_speed)
    return 0.0


@inner()
def _decay_change(column, profile, cell, on):  # type: ignore[no-untyped-def]
    """Change of the coefficient of -v in dv/ds per unit of one strength."""
    if column == QUADRATIC:
        return 2.0 * profile
    if column == FRICTION and on:
        return 2.0 * profile * cell.kappa
    return 0.0


@inner()
def _step_tangent(v, length, a, b, dv, da, db):  # type: ignore[no-untyped-def]
    """Tangent of `step_v` at fixed length."""
    x = b * length
    keep = np.exp(-x)
    return keep * dv + length * (phi1(x) * da - (keep * v + a * length * psi(x)) * db)


@inner()
def _frozen_change(v, section, cell, on, a, b, u1, dv, da, db, shift):  # type: ignore[no-untyped-def]
    """Tangent of the frozen part of the source: how the mean speed of the section changes."""
    u0 = np.sqrt(v)
    if u0 + u1 <= 0.0:
        return 0.0
    du0 = 0.5 * dv / u0 if u0 > 0.0 else 0.0
    by_mean = speed_part_slope(cell, mean_speed(u0, u1))
    known = by_mean * mean_speed_slope(u0, u1) * du0
    if u1 <= 0.0:
        return known
    dv1 = _step_tangent(v, section, a, b, dv, da + known, db)
    dv1 -= (a - b * step_v(v, section, a, b)) * shift
    by_end = by_mean * mean_speed_slope(u1, u0)
    return known + by_end * dv1 / (2.0 * u1 - section * phi1(b * section) * by_end)


@inner()
def _duration_change(u0, u1, length, du0, du1, d_length):  # type: ignore[no-untyped-def]
    """Tangent of the time over a stretch."""
    total = u0 + u1
    return 2.0 * (d_length - length * (du0 + du1) / total) / total


@inner()
def _phase_tangents(  # type: ignore[no-untyped-def]
    v, end, section, distance, ended, skip, a, b, cell, on, columns, profiles, i, dv, shift, d_time
):
    """Tangents over one phase, in place; see `cross_tangents`."""
    u1 = end_speed(v, section, *linear_part(cell, on), cell) if cell.speed_terms else 0.0
    frozen = mean_speed(np.sqrt(v), u1)
    slope = a - b * end
    v_clock = step_v(v, skip, a, b) if skip < distance else 0.0
    u_clock, u_end = np.sqrt(max(v_clock, 0.0)), np.sqrt(end)
    for k in range(dv.size):
        da, db = 0.0, 0.0
        if k < columns.size:
            da = _source_change(columns[k], profiles[k, i], cell, frozen, on)
            db = _decay_change(columns[k], profiles[k, i], cell, on)
        if cell.speed_terms:
            da += _frozen_change(v, section, cell, on, a, b, u1, dv[k], da, db, shift[k])
        at_end = _step_tangent(v, distance, a, b, dv[k], da, db) - slope * shift[k]
        moved = 0.0
        if ended != COVERED:
            moved = -at_end / slope if slope != 0.0 else 0.0
            at_end = 0.0
        if skip < distance:
            d_length, at_clock = moved - shift[k], dv[k]
            if skip > 0.0:
                d_length = moved
                at_clock = _step_tangent(v, skip, a, b, dv[k], da, db) - (a - b * v_clock) * shift[k]
            du_clock = 0.5 * at_clock / u_clock if u_clock > 0.0 else 0.0
            du_end = 0.5 * at_end / u_end if u_end > 0.0 else 0.0
            d_time[k] += _duration_change(u_clock, u_end, distance - skip, du_clock, du_end, d_length)
        dv[k], shift[k] = at_end, moved


@inner()
def cross_tangents(  # type: ignore[no-untyped-def]
    v, length, section, clock, cell, columns, profiles, i, dv, shift, d_time
):
    """As `cross`, and carry tangents along, in place: by each strength and then by anything else.

    Parameters
    ----------
    columns, profiles : arrays
        Of the law, see `Contributions`.
    i : int
        Index of the cell.
    dv : (n,) array
        Tangents of v at the start; on return at the end, at fixed place (0 where the front stops).
    shift : (n,) array
        Tangents of the place of the start; on return 0, or of the stop.
    d_time : (n,) array
        Tangents of the time are added to it.

    """
    on = GRAVITY * cell.cosine + cell.kappa * v >= 0.0
    a, b = coefficients(v, section, cell, on)
    end, distance, ended = end_of_phase(v, length, a, b, switching_threshold(cell), on)
    _phase_tangents(
        v, end, section, distance, ended, clock, a, b, cell, on, columns, profiles, i, dv, shift, d_time
    )
    if ended != SWITCHED:
        return end, distance, ended == STOPPED
    a, b = coefficients(end, section - distance, cell, not on)
    v, switch = end, distance
    end, distance, ended = end_of_phase(v, length - switch, a, b, np.inf, True)
    _phase_tangents(
        v, end, section - switch, distance, ended, max(clock - switch, 0.0), a, b, cell, not on,
        columns, profiles, i, dv, shift, d_time,
    )  # fmt: skip
    return end, switch + distance, ended == STOPPED
