"""A front's march down the track: v = U^2 at every cell edge, and its tangents.

Two passes make it fast. The first turns the coefficients of all cells into the multiplier and the
increment of the exact step v1 = keep v0 + gain, by a short series that vectorises. The second is a
bare multiply-add recursion, two cells at a time to halve the chain of dependent operations. Every
cell in which something happens (release, stop, switch of the normal force, barrier) is left to
`cell.cross`. Fronts with terms in U march abreast, see `march_abreast`.

Indices are unsigned in the loops that matter: a signed one costs a test for wrap-around per access.
"""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.cell import (
    CONSTANT,
    FRICTION,
    LINEAR,
    QUADRATIC,
    SERIES_LIMIT,
    WEAKENING,
    cell_at,
    cross,
    distance_to,
    phi1_series,
    psi_series,
    step_v,
)
from skred.physics.kernel.cell_tangents import cross_tangents
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.inputs import cell_of
from skred.physics.kernel.march_speed import fill_speed_changes
from skred.physics.kernel.scaled_ground import BEND, DOUBLE, DRIVE, WEIGHT

_FAST = {"contract", "nsz", "arcp", "nnan"}
_MAX_HALVINGS = 60
_ONE, _TWO = np.uint64(1), np.uint64(2)


@inner(fastmath=_FAST)
def fill_table(run, strengths, columns, profiles, spans, table):  # type: ignore[no-untyped-def]
    """Sum of strength times profile in the columns that are used; the others must be zero."""
    for k in range(columns.size):
        strength, column = strengths[run, k], columns[k]
        first, end = np.uint64(spans[k, 0]), np.uint64(spans[k, 1])
        first_of_column = True
        for earlier in range(k):
            first_of_column &= columns[earlier] != column
        if first_of_column:
            table[column, :first] = 0.0
            table[column, end:] = 0.0
            for i in range(first, end):
                table[column, i] = strength * profiles[k, i]
        else:
            for i in range(first, end):
                table[column, i] += strength * profiles[k, i]


@inner()
def _halvings(double, bend, quadratic, friction):  # type: ignore[no-untyped-def]
    """How often to halve the largest exponent until the series holds."""
    largest = 0.0
    for i in range(double.size):
        largest = max(largest, abs(double[i] * quadratic[i] + bend[i] * friction[i]))
    halvings = 0
    while largest > SERIES_LIMIT and halvings < _MAX_HALVINGS:
        largest *= 0.5
        halvings += 1
    return halvings


@inner(fastmath=_FAST)
def fill_steps(scaled, table, keep, gain):  # type: ignore[no-untyped-def]
    """First pass: over a whole cell v becomes keep * v + gain, the normal force on.

    Returns how often the exponents had to be halved to lie within reach of the series.
    """
    drive, weight, bend, double = scaled[DRIVE], scaled[WEIGHT], scaled[BEND], scaled[DOUBLE]
    constant, quadratic, friction = table[CONSTANT], table[QUADRATIC], table[FRICTION]
    beyond_series = 0
    for i in range(keep.size):
        x = double[i] * quadratic[i] + bend[i] * friction[i]
        p = phi1_series(x)
        keep[i] = 1.0 - x * p
        gain[i] = (drive[i] - weight[i] * friction[i] - double[i] * constant[i]) * p
        beyond_series += abs(x) > SERIES_LIMIT
    if beyond_series == 0:
        return 0
    halvings = _halvings(double, bend, quadratic, friction)
    part = 0.5**halvings
    for i in range(keep.size):
        x = part * (double[i] * quadratic[i] + bend[i] * friction[i])
        keep[i], gain[i] = x, phi1_series(x)
    for _ in range(halvings):
        # phi1(2 x) = phi1(x) (1 + exp(-x)) / 2
        for i in range(keep.size):
            gain[i] *= 1.0 - 0.5 * keep[i] * gain[i]
            keep[i] *= 2.0
    for i in range(keep.size):
        keep[i] = 1.0 - keep[i] * gain[i]
        gain[i] *= drive[i] - weight[i] * friction[i] - double[i] * constant[i]
    return halvings


@inner()
def travel(v, s_from, s_to, s_end, clock, cell, barriers):  # type: ignore[no-untyped-def]
    """From one place of a cell to another, barriers included: returns (v, s, stopped, time).

    A barrier at the far end is not yet met: the speed there is that of arriving. Nor is one at
    the very place where a front starts from rest. Time [s] is counted from the place `clock` on;
    `s_end` is the cell's lower edge.
    """
    time = 0.0
    for j in range(barriers.shape[0]):
        place, height, loss = barriers[j, 0], barriers[j, 1], barriers[j, 2]
        if place < s_from or (place == s_from and v == 0.0):
            continue
        if place >= s_to:
            s_end = min(s_end, place)
            break
        length = place - s_from
        v, distance, stopped, more = cross(v, length, length, max(clock - s_from, 0.0), cell)
        time += more
        if stopped and distance < length:
            return 0.0, s_from + distance, True, time
        if v < 2.0 * GRAVITY * height or v <= 2.0 * loss:
            return 0.0, place, True, time
        v -= 2.0 * loss
        s_from = place
    v, distance, stopped, more = cross(v, s_to - s_from, s_end - s_from, max(clock - s_from, 0.0), cell)
    return v, s_from + distance, stopped, time + more


@inner()
def travel_tangents(  # type: ignore[no-untyped-def]
    v, s_from, s_to, s_end, clock, cell, barriers, columns, profiles, i, dv, shift, d_time
):
    """As `travel`, with tangents as in `cross_tangents`; a barrier's own strength has none."""
    for j in range(barriers.shape[0]):
        place, height, loss = barriers[j, 0], barriers[j, 1], barriers[j, 2]
        if place < s_from or (place == s_from and v == 0.0):
            continue
        if place >= s_to:
            s_end = min(s_end, place)
            break
        length = place - s_from
        v, distance, stopped = cross_tangents(
            v, length, length, max(clock - s_from, 0.0), cell, columns, profiles, i, dv, shift, d_time
        )
        if stopped and distance < length:
            return 0.0, s_from + distance, True
        if v < 2.0 * GRAVITY * height or v <= 2.0 * loss:
            for k in range(dv.size):
                dv[k] = shift[k] = 0.0
            return 0.0, place, True
        v -= 2.0 * loss
        s_from = place
    v, distance, stopped = cross_tangents(
        v, s_to - s_from, s_end - s_from, max(clock - s_from, 0.0), cell, columns, profiles, i,
        dv, shift, d_time,
    )  # fmt: skip
    return v, s_from + distance, stopped


@inner(fastmath={"contract"})
def _recur(first, keep, gain, limits, v):  # type: ignore[no-untyped-def]
    """Second pass from edge `first` for as long as nothing happens; returns the edge reached."""
    speed = v[first]
    if not speed <= limits[first]:
        return first
    i, n_cells = np.uint64(first), np.uint64(keep.size)
    while i + _ONE < n_cells:
        half = keep[i] * speed + gain[i]
        # Not through `half`: one multiply-add per two cells on the critical path.
        ahead = (keep[i + _ONE] * keep[i]) * speed + (keep[i + _ONE] * gain[i] + gain[i + _ONE])
        if not (0.0 < half <= limits[i + _ONE] and 0.0 < ahead <= limits[i + _TWO]):
            break
        v[i + _ONE] = half
        v[i + _TWO] = ahead
        speed = ahead
        i += _TWO
    if i < n_cells:
        half = keep[i] * speed + gain[i]
        if 0.0 < half <= limits[i + _ONE]:
            v[i + _ONE] = half
            i += _ONE
    return np.int64(i)


@inner()
def contact_law(i, ground, table):  # type: ignore[no-untyped-def]
    """Source and decay of cell i, the normal force on, no terms in U."""
    mu = table[FRICTION, i]
    a = 2.0 * (GRAVITY * (ground[0, i] - mu * ground[1, i]) - table[CONSTANT, i])
    return a, 2.0 * (table[QUADRATIC, i] + mu * ground[2, i])


@inner()
def march(release, start_v, edge, ground, barriers, limits, table, keep, gain, v):  # type: ignore[no-untyped-def]
    """Fill v at every edge; returns (runout [m], last cell entered, cell of the release).

    Without terms in U; for these see `march_abreast`. `start_v` is U^2 at the release [m2 s-2]; v at the
    upper edge of the release's cell holds it, wherever in the cell the front starts.
    """
    n_cells = keep.size
    first = cell_of(edge, release)
    for edge_above in range(first):
        v[edge_above] = 0.0
    v[first] = start_v
    i, start, stopped, s = first, release, False, release
    while not stopped and i < n_cells:
        at_edge = i > first or release == edge[i]
        if at_edge and v[i] <= limits[i]:
            i = _recur(i, keep, gain, limits, v)
            if i == n_cells:
                break
        if i > first:
            start = edge[i]
        plain = at_edge and v[i] > 0.0 and limits[i] > 0.0 and limits[i + 1] > 0.0
        # No barrier then. What is usual among these cells is written out: handing arrays on costs as much as
        # 50 cells.
        done = False
        if plain:
            threshold = -GRAVITY * ground[1, i] / ground[2, i] if ground[2, i] < 0.0 else np.inf
            length, drive = edge[i + 1] - edge[i], GRAVITY * ground[0, i] - table[CONSTANT, i]
            if v[i] <= threshold:
                ahead = keep[i] * v[i] + gain[i]
                if ahead <= 0.0:
                    mu = table[FRICTION, i]
                    a = 2.0 * (drive - mu * GRAVITY * ground[1, i])
                    b = 2.0 * (table[QUADRATIC, i] + mu * ground[2, i])
                    s, stopped, ahead = start + min(distance_to(v[i], 0.0, a, b), length), True, 0.0
                done = ahead <= threshold
            else:
                a, b = 2.0 * drive, 2.0 * table[QUADRATIC, i]
                ahead = step_v(v[i], length, a, b)
                done = ahead >= threshold  # still off the ground
            v[i + 1] = ahead
        if not done:
            cell, end = cell_at(i, ground, table, np.inf, False), edge[i + 1]
            v[i + 1], s, stopped, _ = travel(v[i], start, end, end, np.inf, cell, barriers)
        i += 1
    for edge_below in range(i + 1, n_cells + 1):
        v[edge_below] = 0.0
    return (s if stopped else edge[n_cells]), i - 1, first


@inner()
def is_regular(i, first, limits, v):  # type: ignore[no-untyped-def]
    """Whether nothing happens in cell i: it is crossed whole, in contact."""
    if i <= first:
        return False
    return v[i] <= limits[i] and 0.0 < v[i + 1] <= limits[i + 1]


@inner(fastmath=_FAST)
def fill_changes(halvings, scaled, table, keep, v, by_source, by_decay):  # type: ignore[no-untyped-def]
    """Change of v over each whole cell per unit of source and of decay, divided by its length.

    The tangents of the exact step: phi1, and keep v + (a length) psi, which is minus by_decay.
    """
    drive, weight, bend, double = scaled[DRIVE], scaled[WEIGHT], scaled[BEND], scaled[DOUBLE]
    constant, quadratic, friction = table[CONSTANT], table[QUADRATIC], table[FRICTION]
    part = 0.5**halvings
    for i in range(keep.size):
        x = part * (double[i] * quadratic[i] + bend[i] * friction[i])
        by_source[i], by_decay[i] = phi1_series(x), psi_series(x)
    for _ in range(halvings):
        for i in range(keep.size):
            x, p = part * (double[i] * quadratic[i] + bend[i] * friction[i]), by_source[i]
            # Derivative of phi1(2 x) = phi1(x) (1 - x phi1(x) / 2)
            by_decay[i] = 0.5 * (by_decay[i] * (1.0 - x * p) + 0.5 * p * p)
            by_source[i] = p * (1.0 - 0.5 * x * p)
        part *= 2.0
    for i in range(keep.size):
        impulse = drive[i] - weight[i] * friction[i] - double[i] * constant[i]
        by_decay[i] = -(keep[i] * v[i] + impulse * by_decay[i])


@inner(fastmath=_FAST)
def _fill_increment(column, profile, scaled, u_c, mean, by_source, by_decay, increment):  # type: ignore[no-untyped-def]
    """What each whole cell adds to the tangent of v by one strength."""
    weight, bend, double = scaled[WEIGHT], scaled[BEND], scaled[DOUBLE]
    if column == CONSTANT:
        for i in range(increment.size):
            increment[i] = -double[i] * by_source[i] * profile[i]
    elif column == QUADRATIC:
        for i in range(increment.size):
            increment[i] = double[i] * by_decay[i] * profile[i]
    elif column == LINEAR:
        for i in range(increment.size):
            increment[i] = -double[i] * by_source[i] * mean[i] * profile[i]
    elif column == WEAKENING:
        for i in range(increment.size):
            increment[i] = -weight[i] * by_source[i] / (1.0 + mean[i] / u_c) * profile[i]
    else:
        for i in range(increment.size):
            increment[i] = (bend[i] * by_decay[i] - weight[i] * by_source[i]) * profile[i]


@inner()
def regular_until(first, end, limits, v):  # type: ignore[no-untyped-def]
    """First cell from `first` on, or `end`, in which something happens; see `is_regular`."""
    i, stop = np.uint64(first), np.uint64(end)
    while i < stop and v[i] <= limits[i] and 0.0 < v[i + _ONE] <= limits[i + _ONE]:
        i += _ONE
    return np.int64(i)


@inner(fastmath={"contract"})
def _recur_tangent(k, first, last, keep, increment, dv):  # type: ignore[no-untyped-def]
    """Tangent from edge `first` to edge `last`, two cells at a time as in `_recur`."""
    i, end, row = np.uint64(first), np.uint64(last), np.uint64(k)
    tangent = dv[row, i]
    while i + _ONE < end:
        dv[row, i + _ONE] = keep[i] * tangent + increment[row, i]
        tangent = (keep[i + _ONE] * keep[i]) * tangent + (
            keep[i + _ONE] * increment[row, i] + increment[row, i + _ONE]
        )
        dv[row, i + _TWO] = tangent
        i += _TWO
    if i < end:
        dv[row, i + _ONE] = keep[i] * tangent + increment[row, i]


@inner()
def start_tangents(i, first, release, n_strengths, v, edge, dv, step, shift):  # type: ignore[no-untyped-def]
    """Tangents of v and of the place at which a front enters cell i; returns that place.

    By each strength, then by the place of the release and, where there is one more, by the speed there.
    """
    for k in range(step.size):
        step[k] = 0.0 if i == first else dv[k, i]
        shift[k] = 0.0
    if i > first:
        return edge[i]
    shift[n_strengths] = 1.0
    if step.size > n_strengths + 1:
        step[n_strengths + 1] = 2.0 * np.sqrt(v[first])
    return release


@inner()
def march_tangents(  # type: ignore[no-untyped-def]
    release, last, first, edge, ground, barriers, limits, columns, profiles, u_c, speed_terms,
    table, carry, v, increment, dv, step, shift, d_time, d_runout,
):  # fmt: skip
    """Fill dv (n_tangents, n_cells + 1) and d_runout: by each strength, then by the release.

    `carry` (n_cells) and `increment` (n_tangents, n_cells) hold what regular cells keep and add; edges
    above the release or below the stop are left alone.
    """
    n_tangents = d_runout.size
    d_runout[:] = 0.0
    i = first
    while i <= last:
        regular_to = i if i == first else regular_until(i, last + 1, limits, v)
        if regular_to > i:
            for k in range(n_tangents):
                _recur_tangent(k, i, regular_to, carry, increment, dv)
            i = regular_to
            continue
        start = start_tangents(i, first, release, columns.size, v, edge, dv, step, shift)
        cell, end = cell_at(i, ground, table, u_c, speed_terms), edge[i + 1]
        _, s, stopped = travel_tangents(
            v[i], start, end, end, np.inf, cell, barriers, columns, profiles, i, step, shift, d_time
        )
        if stopped:
            for k in range(n_tangents):
                d_runout[k] = shift[k]
            if s <= release:
                d_runout[:] = 0.0
                d_runout[columns.size] = 1.0
            return
        for k in range(n_tangents):
            dv[k, i + 1] = step[k]
        i += 1


@inner(fastmath=_FAST)
def fill_increments(  # type: ignore[no-untyped-def]
    halvings, scaled, ground, table, keep, v, columns, profiles, u_c, speed_terms,
    by_source, by_decay, mean, soften, carry, increment,
):  # fmt: skip
    """What regular cells keep of the tangents of v, and add: rows as the strengths, 0 for the release."""
    fill_changes(halvings, scaled, table, keep, v, by_source, by_decay)
    if speed_terms:
        fill_speed_changes(scaled, ground, table, u_c, keep, v, by_source, by_decay, mean, soften, carry)
    else:
        for i in range(carry.size):
            carry[i] = keep[i]
    for k in range(columns.size):
        _fill_increment(columns[k], profiles[k], scaled, u_c, mean, by_source, by_decay, increment[k])
        if speed_terms:
            for i in range(carry.size):
                increment[k, i] *= soften[i]
