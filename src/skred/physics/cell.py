"""One front through (part of) one cell, in closed form, with its tangents.

Within a cell the coefficients are constant, so the equation of motion is autonomous and v = U^2
is monotone along it: the normal force switches off or on at most once, and v reaches zero at most
once. All cases that the vectorised recursion of the kernel cannot take go through `cross`:
the release, the stop, the switch of the normal force, barriers, sensors, and terms in U.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.physics.columns import GRAVITY, Column
from skred.physics.compiled import compiled

CONSTANT, LINEAR, QUADRATIC, FRICTION, WEAKENING = (int(column) for column in Column)


class Cell(NamedTuple):
    """What one cell holds: its ground and the law's coefficients there (scalars only)."""

    sine: float
    cosine: float
    kappa: float
    constant: float
    linear: float
    quadratic: float
    friction: float
    weakening: float
    weakening_speed: float
    speed_terms: bool


COVERED, SWITCHED, STOPPED = 0, 1, 2
"""How a phase ended: the length covered, the normal force switched, or the front at rest."""
SERIES_LIMIT = 0.5
"""Largest exponent for which twelve terms of the series reach double precision."""


@compiled(fastmath={"contract"}, inline="always")
def phi1_series(x):  # type: ignore[no-untyped-def]
    """(1 - exp(-x)) / x for |x| <= 0.5."""
    p = 1.0 / 479001600.0
    p = 1.0 / 39916800.0 - x * p
    p = 1.0 / 3628800.0 - x * p
    p = 1.0 / 362880.0 - x * p
    p = 1.0 / 40320.0 - x * p
    p = 1.0 / 5040.0 - x * p
    p = 1.0 / 720.0 - x * p
    p = 1.0 / 120.0 - x * p
    p = 1.0 / 24.0 - x * p
    p = 1.0 / 6.0 - x * p
    p = 0.5 - x * p
    return 1.0 - x * p


@compiled(fastmath={"contract"}, inline="always")
def psi_series(x):  # type: ignore[no-untyped-def]
    """Minus the derivative of phi1, for |x| <= 0.5."""
    p = 12.0 / 6227020800.0
    p = 11.0 / 479001600.0 - x * p
    p = 10.0 / 39916800.0 - x * p
    p = 9.0 / 3628800.0 - x * p
    p = 8.0 / 362880.0 - x * p
    p = 7.0 / 40320.0 - x * p
    p = 6.0 / 5040.0 - x * p
    p = 5.0 / 720.0 - x * p
    p = 4.0 / 120.0 - x * p
    p = 3.0 / 24.0 - x * p
    p = 2.0 / 6.0 - x * p
    return 0.5 - x * p


@compiled()
def phi1(x):  # type: ignore[no-untyped-def]
    """(1 - exp(-x)) / x for any x."""
    if abs(x) <= SERIES_LIMIT:
        return phi1_series(x)
    return -np.expm1(-x) / x


@compiled()
def psi(x):  # type: ignore[no-untyped-def]
    """Minus the derivative of phi1, for any x."""
    if abs(x) <= SERIES_LIMIT:
        return psi_series(x)
    return (-np.expm1(-x) / x - np.exp(-x)) / x


@compiled()
def distance_to(v, target, a, b):  # type: ignore[no-untyped-def]
    """Distance [m] at which dv/ds = a - b v carries v to `target`."""
    first_order = (target - v) / (a - b * v)
    y = b * first_order
    if abs(y) < 1e-8:
        return first_order * (1.0 + 0.5 * y)
    return -np.log1p(-y) / b


@compiled()
def mean_speed(u0, u1):  # type: ignore[no-untyped-def]
    """Mean of U over a stretch on which U^2 is linear: exact at start and stop as well."""
    if u0 + u1 <= 0.0:
        return 0.0
    return (u0 * u0 + u0 * u1 + u1 * u1) / (1.5 * (u0 + u1))


@compiled()
def mean_speed_slope(u0, u1):  # type: ignore[no-untyped-def]
    """Derivative of `mean_speed` with respect to its first argument."""
    total = u0 + u1
    return (2.0 * u0 + u1 - (u0 * u0 + u0 * u1 + u1 * u1) / total) / (1.5 * total)


@compiled()
def _half_tangent(tangent, u):  # type: ignore[no-untyped-def]
    """DU from dv; a front at rest has no tangent in U."""
    return 0.5 * tangent / u if u > 0.0 else 0.0


@compiled(inline="always")
def cell_at(i, ground, table, weakening_speed, speed_terms):  # type: ignore[no-untyped-def]
    """Gather the scalars of cell i."""
    return Cell(
        ground[0, i],
        ground[1, i],
        ground[2, i],
        table[CONSTANT, i],
        table[LINEAR, i],
        table[QUADRATIC, i],
        table[FRICTION, i],
        table[WEAKENING, i],
        weakening_speed,
        speed_terms,
    )


@compiled()
def slope_of_v(v, cell):  # type: ignore[no-untyped-def]
    """dv/ds [m s-2]."""
    retardation = cell.constant + cell.quadratic * v
    retardation += cell.friction * max(0.0, GRAVITY * cell.cosine + cell.kappa * v)
    return 2.0 * (GRAVITY * cell.sine - retardation) + _speed_part(cell, np.sqrt(v))


@compiled()
def _speed_part(cell, u):  # type: ignore[no-untyped-def]
    """The terms in U of dv/ds, frozen at speed u."""
    weakening = cell.weakening * GRAVITY * cell.cosine / (1.0 + u / cell.weakening_speed)
    return -2.0 * (cell.linear * u + weakening)


@compiled()
def _speed_part_slope(cell, u):  # type: ignore[no-untyped-def]
    """Derivative of `_speed_part` by u."""
    relative = 1.0 + u / cell.weakening_speed
    weakening = cell.weakening * GRAVITY * cell.cosine / (cell.weakening_speed * relative**2)
    return -2.0 * (cell.linear - weakening)


@compiled()
def _linear_part(cell, on):  # type: ignore[no-untyped-def]
    """Source a and decay b of dv/ds = a - b v without the terms in U."""
    mu = cell.friction if on else 0.0
    source = 2.0 * (GRAVITY * (cell.sine - mu * cell.cosine) - cell.constant)
    return source, 2.0 * (cell.quadratic + mu * cell.kappa)


@compiled()
def step_v(v, length, a, b):  # type: ignore[no-untyped-def]
    """Exact solution of dv/ds = a - b v after `length` metres."""
    return v - (b * v - a) * length * phi1(b * length)


@compiled()
def _end_of_phase(v, length, a, b, threshold, on):  # type: ignore[no-untyped-def]
    """Follow dv/ds = a - b v until something ends it: returns (v, distance, how it ended)."""
    end = step_v(v, length, a, b)
    if end <= 0.0:
        distance = min(distance_to(v, 0.0, a, b), length) if v > 0.0 else 0.0
        return 0.0, distance, STOPPED
    if (on and end > threshold) or (not on and end < threshold):
        distance = min(distance_to(v, threshold, a, b), length) if v != threshold else 0.0
        return threshold, distance, SWITCHED
    return end, length, COVERED


@compiled()
def _freeze_speed(v, length, cell, on):  # type: ignore[no-untyped-def]
    """Speed at the end by a predictor, and the mean speed at which terms in U are frozen."""
    a, b = _linear_part(cell, on)
    u0 = np.sqrt(v)
    u1 = np.sqrt(max(step_v(v, length, a + _speed_part(cell, u0), b), 0.0))
    return u1, mean_speed(u0, u1)


@compiled()
def _phase(v, length, cell, on):  # type: ignore[no-untyped-def]
    """One phase of the normal force: returns (v, distance, how it ended)."""
    a, b = _linear_part(cell, on)
    if cell.speed_terms:
        a += _speed_part(cell, _freeze_speed(v, length, cell, on)[1])
    threshold = -GRAVITY * cell.cosine / cell.kappa if cell.kappa < 0.0 else np.inf
    return _end_of_phase(v, length, a, b, threshold, on)


@compiled()
def cross(v, length, cell):  # type: ignore[no-untyped-def]
    """Carry a front over `length` metres of one cell.

    Parameters
    ----------
    v : float, m2 s-2
        Squared front speed at the start; 0 for a front at rest that may start.
    length : float, m
        How far to go inside the cell.
    cell : Cell

    Returns
    -------
    v, distance, stopped : float, float, bool
        Squared speed at the end [m2 s-2], distance covered [m], whether the front stopped.

    """
    on = GRAVITY * cell.cosine + cell.kappa * v >= 0.0
    covered = 0.0
    # At most two phases: v is monotone within a cell.
    for _ in range(2):
        v, distance, ended = _phase(v, length - covered, cell, on)
        covered += distance
        if ended == STOPPED:
            return 0.0, covered, True
        if ended == COVERED:
            break
        on = not on
    return v, length, False


@compiled()
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


@compiled()
def _decay_change(column, profile, cell, on):  # type: ignore[no-untyped-def]
    """Change of the coefficient of -v in dv/ds per unit of one strength."""
    if column == QUADRATIC:
        return 2.0 * profile
    if column == FRICTION and on:
        return 2.0 * profile * cell.kappa
    return 0.0


@compiled()
def _step_tangent(v, length, a, b, dv, da, db):  # type: ignore[no-untyped-def]
    """Tangent of `step_v` at fixed length."""
    x = b * length
    keep = np.exp(-x)
    return keep * dv + length * (phi1(x) * da - (keep * v + a * length * psi(x)) * db)


@compiled()
def _phase_tangents(v, length, distance, cell, on, law, i, tangents):  # type: ignore[no-untyped-def]
    """Tangents over the phase that `_phase` followed for `distance`; returns dv/ds at its end."""
    a, b = _linear_part(cell, on)
    u0, u1, frozen = np.sqrt(v), 0.0, 0.0
    a0 = a
    if cell.speed_terms:
        u1, frozen = _freeze_speed(v, length, cell, on)
        a0 = a + _speed_part(cell, u0)
        a += _speed_part(cell, frozen)
    for k in range(tangents.size):
        incoming, da, db = tangents[k], 0.0, 0.0
        in_law = k < law.columns.size
        if in_law:
            da = _source_change(law.columns[k], law.profiles[k, i], cell, frozen, on)
            db = _decay_change(law.columns[k], law.profiles[k, i], cell, on)
        if cell.speed_terms and u0 + u1 > 0.0:
            du0 = 0.5 * incoming / u0 if u0 > 0.0 else 0.0
            du1 = 0.0
            if u1 > 0.0:
                da0 = _speed_part_slope(cell, u0) * du0
                if in_law:
                    da0 += _source_change(law.columns[k], law.profiles[k, i], cell, u0, on)
                du1 = 0.5 * _step_tangent(v, length, a0, b, incoming, da0, db) / u1
            d_frozen = mean_speed_slope(u0, u1) * du0 + mean_speed_slope(u1, u0) * du1
            da += _speed_part_slope(cell, frozen) * d_frozen
        tangents[k] = _step_tangent(v, distance, a, b, incoming, da, db)
    return a - b * step_v(v, distance, a, b)


@compiled()
def cross_tangents(v, length, cell, law, i, tangents):  # type: ignore[no-untyped-def]
    """As `cross`, and carry the tangents along, in place.

    Parameters
    ----------
    law : Contributions
    i : int
        Index of the cell.
    tangents : (n,) array, changed in place
        dv at the start on entry, by each strength of the law and then by anything else. On return
        dv at the end, at fixed place; where the front stops, the derivative of that place instead.

    """
    on = GRAVITY * cell.cosine + cell.kappa * v >= 0.0
    covered = 0.0
    for _ in range(2):
        end, distance, ended = _phase(v, length - covered, cell, on)
        slope = _phase_tangents(v, length - covered, distance, cell, on, law, i, tangents)
        v = end
        covered += distance
        if ended == STOPPED:
            for k in range(tangents.size):
                tangents[k] = -tangents[k] / slope if slope < 0.0 else 0.0
            return 0.0, covered, True
        if ended == COVERED:
            break
        on = not on
    return v, length, False
