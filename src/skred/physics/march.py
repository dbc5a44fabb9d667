"""A front's march down the track: v = U^2 at every cell edge, and its tangents.

Two passes make it fast. The first turns the coefficients of all cells into the multiplier and the
increment of the exact step v1 = keep v0 + gain, by a short series that vectorises. The second is a
bare multiply-add recursion, two cells at a time to halve the chain of dependent operations. Every
cell in which something happens (release, stop, switch of the normal force, barrier, terms in U) is
left to `cell.cross`.
"""

from __future__ import annotations

import numpy as np

from skred.physics.cell import (
    CONSTANT,
    FRICTION,
    QUADRATIC,
    SERIES_LIMIT,
    cell_at,
    cross,
    cross_tangents,
    phi1,
    phi1_series,
    psi,
    slope_of_v,
)
from skred.physics.columns import GRAVITY
from skred.physics.compiled import compiled
from skred.physics.inputs import cell_of

_FAST = {"contract", "nsz", "arcp", "nnan"}


@compiled(fastmath=_FAST)
def fill_table(strengths, columns, profiles, table):  # type: ignore[no-untyped-def]
    """Sum of strength times profile in the columns that are used; the others must be zero."""
    n_cells = table.shape[1]
    for k in range(strengths.size):
        column = columns[k]
        for i in range(n_cells):
            table[column, i] = 0.0
    for k in range(strengths.size):
        strength, column = strengths[k], columns[k]
        for i in range(n_cells):
            table[column, i] += strength * profiles[k, i]


@compiled(fastmath=_FAST)
def fill_steps(edge, ground, table, keep, gain):  # type: ignore[no-untyped-def]
    """First pass: over a whole cell v becomes keep * v + gain, the normal force on."""
    sine, cosine, kappa = ground[0], ground[1], ground[2]
    constant, quadratic, friction = table[CONSTANT], table[QUADRATIC], table[FRICTION]
    beyond_series = 0
    for i in range(keep.size):
        length = edge[i + 1] - edge[i]
        x = 2.0 * (quadratic[i] + friction[i] * kappa[i]) * length
        a = 2.0 * (GRAVITY * (sine[i] - friction[i] * cosine[i]) - constant[i])
        p = phi1_series(x)
        keep[i] = 1.0 - x * p
        gain[i] = a * length * p
        beyond_series += abs(x) > SERIES_LIMIT
    if beyond_series == 0:
        return
    for i in range(keep.size):
        length = edge[i + 1] - edge[i]
        x = 2.0 * (quadratic[i] + friction[i] * kappa[i]) * length
        if abs(x) > SERIES_LIMIT:
            a = 2.0 * (GRAVITY * (sine[i] - friction[i] * cosine[i]) - constant[i])
            keep[i] = np.exp(-x)
            gain[i] = a * length * phi1(x)


@compiled()
def _next_barrier(barriers, s_from, s_to):  # type: ignore[no-untyped-def]
    """Index of the first barrier in [s_from, s_to), or -1."""
    for j in range(barriers.shape[0]):
        if s_from <= barriers[j, 0] < s_to:
            return j
    return -1


@compiled()
def travel(v, s_from, s_to, cell, barriers):  # type: ignore[no-untyped-def]
    """From one place of a cell to another, barriers included: returns (v, s, stopped).

    A barrier at the far end is not yet met: the speed there is that of arriving.
    """
    for j in range(max(_next_barrier(barriers, s_from, s_to), 0), barriers.shape[0]):
        place, height, loss = barriers[j, 0], barriers[j, 1], barriers[j, 2]
        if not s_from <= place < s_to:
            break
        v, distance, stopped = cross(v, place - s_from, cell)
        if stopped and distance < place - s_from:
            return 0.0, s_from + distance, True
        if v < 2.0 * GRAVITY * height or v <= 2.0 * loss:
            return 0.0, place, True
        v -= 2.0 * loss
        s_from = place
    v, distance, stopped = cross(v, s_to - s_from, cell)
    return v, s_from + distance, stopped


@compiled()
def travel_tangents(v, s_from, s_to, cell, barriers, law, i, tangents):  # type: ignore[no-untyped-def]
    """As `travel`, with tangents as in `cross_tangents`; a barrier's own strength has none."""
    for j in range(max(_next_barrier(barriers, s_from, s_to), 0), barriers.shape[0]):
        place, height, loss = barriers[j, 0], barriers[j, 1], barriers[j, 2]
        if not s_from <= place < s_to:
            break
        v, distance, stopped = cross_tangents(v, place - s_from, cell, law, i, tangents)
        if stopped and distance < place - s_from:
            return 0.0, s_from + distance, True
        if v < 2.0 * GRAVITY * height or v <= 2.0 * loss:
            tangents[:] = 0.0
            return 0.0, place, True
        v -= 2.0 * loss
        s_from = place
    v, distance, stopped = cross_tangents(v, s_to - s_from, cell, law, i, tangents)
    return v, s_from + distance, stopped


@compiled(fastmath={"contract"})
def _recur(first, keep, gain, limits, v):  # type: ignore[no-untyped-def]
    """Second pass from edge `first` for as long as nothing happens; returns the edge reached."""
    speed = v[first]
    if not speed <= limits[first]:
        return first
    # Unsigned indices: signed ones cost a wrap-around test per access, half of the loop's time.
    one, two = np.uint64(1), np.uint64(2)
    for pair in range((keep.size - first) // 2):
        i = np.uint64(first + 2 * pair)
        half = keep[i] * speed + gain[i]
        # Not through `half`: one multiply-add per two cells on the critical path.
        ahead = (keep[i + one] * keep[i]) * speed + (keep[i + one] * gain[i] + gain[i + one])
        if not (0.0 < half <= limits[i + one] and 0.0 < ahead <= limits[i + two]):
            return first + 2 * pair
        v[i + one] = half
        v[i + two] = ahead
        speed = ahead
    return first + 2 * ((keep.size - first) // 2)


@compiled()
def march(  # type: ignore[no-untyped-def]
    release, edge, ground, barriers, limits, u_c, speed_terms, table, keep, gain, v
):
    """Fill v at every edge; returns (runout [m], last cell entered, cell of the release)."""
    n_cells = keep.size
    first = cell_of(edge, release)
    for edge_above in range(first + 1):
        v[edge_above] = 0.0
    cell = cell_at(first, ground, table, u_c, speed_terms)
    v[first + 1], s, stopped = travel(0.0, release, edge[first + 1], cell, barriers)
    i = first + 1
    while not stopped and i < n_cells:
        if not speed_terms:
            i = _recur(i, keep, gain, limits, v)
            if i == n_cells:
                break
        cell = cell_at(i, ground, table, u_c, speed_terms)
        v[i + 1], s, stopped = travel(v[i], edge[i], edge[i + 1], cell, barriers)
        i += 1
    for edge_below in range(i + 1, n_cells + 1):
        v[edge_below] = 0.0
    return (s if stopped else edge[n_cells]), i - 1, first


@compiled(fastmath={"contract"})
def march_tangents(release, path, law, table, keep, v, last, first, dv, d_runout):  # type: ignore[no-untyped-def]
    """Fill dv at every edge and d_runout: by each strength and, last, by the release place."""
    edge, ground, barriers, limits = path.edge, path.ground, path.barriers, path.limits
    columns, profiles = law.columns, law.profiles
    u_c, speed_terms = law.weakening_speed, law.speed_terms
    n_strengths = columns.size
    step = np.zeros(d_runout.size)
    dv[:] = 0.0
    d_runout[:] = 0.0
    for i in range(first, last + 1):
        cell = cell_at(i, ground, table, u_c, speed_terms)
        regular = i > first and not speed_terms
        if regular and v[i] <= limits[i] and 0.0 < v[i + 1] <= limits[i + 1]:
            length = edge[i + 1] - edge[i]
            b = 2.0 * (cell.quadratic + cell.friction * cell.kappa)
            a = 2.0 * (GRAVITY * (cell.sine - cell.friction * cell.cosine) - cell.constant)
            by_source = 2.0 * length * phi1(b * length)
            by_decay = -2.0 * length * (keep[i] * v[i] + a * length * psi(b * length))
            by_friction = by_decay * cell.kappa - by_source * GRAVITY * cell.cosine
            for k in range(n_strengths):
                by_column = by_friction
                if columns[k] == CONSTANT:
                    by_column = -by_source
                elif columns[k] == QUADRATIC:
                    by_column = by_decay
                dv[i + 1, k] = keep[i] * dv[i, k] + by_column * profiles[k, i]
            dv[i + 1, n_strengths] = keep[i] * dv[i, n_strengths]
            continue
        step[:] = dv[i]
        start = edge[i]
        if i == first:
            start = release
            step[n_strengths] = -slope_of_v(0.0, cell)
        ahead, s, stopped = travel_tangents(v[i], start, edge[i + 1], cell, barriers, law, i, step)
        if stopped:
            d_runout[:] = step
            if s <= release:
                d_runout[n_strengths] = 1.0
            return
        if i == first and speed_terms:
            # U has no tangent at rest; v has one cell further on, to the order of the scheme.
            step[n_strengths] = -slope_of_v(ahead, cell)
        dv[i + 1] = step
