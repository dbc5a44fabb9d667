"""One front through (part of) one cell, in closed form; its tangents are in `cell_tangents`.

Within a cell the coefficients are constant, so the equation of motion is autonomous and v = U^2
is monotone along it: the normal force switches off or on at most once, and v reaches zero at most
once. All cases that the vectorised recursion of the kernel cannot take go through `cross`:
the release, the stop, the switch of the normal force, barriers, and terms in U.

Terms in U are frozen at the mean speed of a stretch. That mean is solved for, not predicted: an explicit
predictor overshoots where such a term limits the speed within the first cell, and the front would
seem to stop at its release.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.columns import GRAVITY, Column

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
_MAX_ITERATIONS = 60
_ACCURACY = 1e-15


@inner(fastmath={"contract"}, inline="always")
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


@inner(fastmath={"contract"}, inline="always")
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


@inner()
def phi1(x):  # type: ignore[no-untyped-def]
    """(1 - exp(-x)) / x for any x."""
    if abs(x) <= SERIES_LIMIT:
        return phi1_series(x)
    return -np.expm1(-x) / x


@inner()
def psi(x):  # type: ignore[no-untyped-def]
    """Minus the derivative of phi1, for any x."""
    if abs(x) <= SERIES_LIMIT:
        return psi_series(x)
    return (-np.expm1(-x) / x - np.exp(-x)) / x


@inner()
def distance_to(v, target, a, b):  # type: ignore[no-untyped-def]
    """Distance [m] at which dv/ds = a - b v carries v to `target`; inf where it never does."""
    if v == target:
        return 0.0
    first_order = (target - v) / (a - b * v)
    y = b * first_order
    if abs(y) < 1e-8:
        return first_order * (1.0 + 0.5 * y)
    return -np.log1p(-y) / b if y < 1.0 else np.inf


@inner()
def mean_speed(u0, u1):  # type: ignore[no-untyped-def]
    """Mean of U over a stretch on which U^2 is linear: exact at start and stop as well."""
    if u0 + u1 <= 0.0:
        return 0.0
    return (u0 * u0 + u0 * u1 + u1 * u1) / (1.5 * (u0 + u1))


@inner()
def mean_speed_slope(u0, u1):  # type: ignore[no-untyped-def]
    """Derivative of `mean_speed` with respect to its first argument."""
    total = u0 + u1
    return (2.0 * u0 + u1 - (u0 * u0 + u0 * u1 + u1 * u1) / total) / (1.5 * total)


@inner()
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


@inner()
def _speed_part(cell, u):  # type: ignore[no-untyped-def]
    """The terms in U of dv/ds, frozen at speed u."""
    weakening = cell.weakening * GRAVITY * cell.cosine / (1.0 + u / cell.weakening_speed)
    return -2.0 * (cell.linear * u + weakening)


@inner()
def speed_part_slope(cell, u):  # type: ignore[no-untyped-def]
    """Derivative of `_speed_part` by u."""
    relative = 1.0 + u / cell.weakening_speed
    weakening = cell.weakening * GRAVITY * cell.cosine / (cell.weakening_speed * relative**2)
    return -2.0 * (cell.linear - weakening)


@inner()
def linear_part(cell, on):  # type: ignore[no-untyped-def]
    """Source a and decay b of dv/ds = a - b v without the terms in U."""
    mu = cell.friction if on else 0.0
    source = 2.0 * (GRAVITY * (cell.sine - mu * cell.cosine) - cell.constant)
    return source, 2.0 * (cell.quadratic + mu * cell.kappa)


@inner()
def step_v(v, length, a, b):  # type: ignore[no-untyped-def]
    """Exact solution of dv/ds = a - b v after `length` metres."""
    return v - (b * v - a) * length * phi1(b * length)


@inner()
def end_speed(v, length, a, b, cell):  # type: ignore[no-untyped-def]
    """Speed at the end of a stretch that fits the terms in U frozen at the stretch's mean speed.

    Newton's method, kept between two speeds that enclose the solution; 0 for a front that stops.
    """
    u0 = np.sqrt(v)
    per_source = length * phi1(b * length)
    carried = v + (a - b * v) * per_source
    if a - b * v + _speed_part(cell, u0) > 0.0:
        low, high = u0, np.sqrt(carried)
    elif carried + per_source * _speed_part(cell, mean_speed(u0, 0.0)) > 0.0:
        low, high = 0.0, u0
    else:
        return 0.0
    u1 = high
    for _ in range(_MAX_ITERATIONS):
        mean = mean_speed(u0, u1)
        speed_part = per_source * _speed_part(cell, mean)
        excess = carried + speed_part - u1 * u1
        if abs(excess) <= _ACCURACY * (abs(carried) + abs(speed_part)):
            break
        if excess > 0.0:
            low = u1
        else:
            high = u1
        by_mean = per_source * speed_part_slope(cell, mean)
        u1 -= excess / (by_mean * mean_speed_slope(u1, u0) - 2.0 * u1)
        if not low <= u1 <= high:
            u1 = 0.5 * (low + high)
    return u1


@inner()
def coefficients(v, section, cell, on):  # type: ignore[no-untyped-def]
    """Source and decay of one phase, the terms in U frozen over the rest of the section."""
    a, b = linear_part(cell, on)
    if cell.speed_terms:
        u1 = end_speed(v, section, a, b, cell)
        a += _speed_part(cell, mean_speed(np.sqrt(v), u1))
    return a, b


@inner()
def switching_threshold(cell):  # type: ignore[no-untyped-def]
    """Squared speed above which a convex cell's normal force vanishes."""
    return -GRAVITY * cell.cosine / cell.kappa if cell.kappa < 0.0 else np.inf


@inner()
def end_of_phase(v, length, a, b, threshold, on):  # type: ignore[no-untyped-def]
    """Follow dv/ds = a - b v until something ends it: returns (v, distance, how it ended).

    After a switch the threshold is inf: there is no second one.
    """
    end = step_v(v, length, a, b)
    # The switch first: a front above the ground cannot stop before it is back on it.
    if (on and end > threshold) or (not on and end < threshold):
        return threshold, min(distance_to(v, threshold, a, b), length), SWITCHED
    if end <= 0.0:
        return 0.0, min(distance_to(v, 0.0, a, b), length), STOPPED
    return end, length, COVERED


@inner()
def _duration(v, end, distance, skip, a, b):  # type: ignore[no-untyped-def]
    """Time [s] over a phase from `skip` metres on: length over the mean of the speeds at its ends."""
    length = distance - skip
    if length <= 0.0:
        return 0.0
    return 2.0 * length / (np.sqrt(max(step_v(v, skip, a, b), 0.0)) + np.sqrt(end))


@inner()
def cross(v, length, section, clock, cell):  # type: ignore[no-untyped-def]
    """Carry a front over `length` metres of one cell.

    Parameters
    ----------
    v : float, m2 s-2
        Squared front speed at the start; 0 for a front at rest that may start.
    length : float, m
        How far to go inside the cell.
    section : float, m
        Length over which terms in U are frozen, at least `length`: to the next edge or barrier.
    clock : float, m
        Distance from which on time is counted; inf for not at all.
    cell : Cell

    Returns
    -------
    v, distance, stopped, time : float, float, bool, float
        Squared speed at the end [m2 s-2], distance covered [m], whether the front stopped, time [s].

    """
    on = GRAVITY * cell.cosine + cell.kappa * v >= 0.0
    a, b = coefficients(v, section, cell, on)
    end, distance, ended = end_of_phase(v, length, a, b, switching_threshold(cell), on)
    time = _duration(v, end, distance, clock, a, b) if clock < length else 0.0
    if ended != SWITCHED:
        return end, distance, ended == STOPPED, time
    # At most two phases: v is monotone within a cell.
    a, b = coefficients(end, section - distance, cell, not on)
    v, switch = end, distance
    end, distance, ended = end_of_phase(v, length - switch, a, b, np.inf, True)
    if clock < length:
        time += _duration(v, end, distance, max(clock - switch, 0.0), a, b)
    return end, switch + distance, ended == STOPPED, time
