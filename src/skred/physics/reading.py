"""Reading a front as the instruments do: speed at a point, mean speed over a span, runout."""

from __future__ import annotations

import numpy as np

from skred.physics.cell import cell_at, slope_of_v
from skred.physics.compiled import compiled
from skred.physics.inputs import RUNOUT
from skred.physics.march import travel, travel_tangents


@compiled()
def _comes_by(place, release, runout, edge, v):  # type: ignore[no-untyped-def]
    """Whether the front passes a place with speed; it may do so at the very end of the track."""
    return release < place < runout or (place == edge[-1] and v[-1] > 0.0)


@compiled()
def speed_at(  # type: ignore[no-untyped-def]
    place, i, release, runout, first, edge, ground, barriers, u_c, speed_terms, table, v
):
    """Front speed [m/s] at a place in cell i; 0 where the front does not come."""
    if not _comes_by(place, release, runout, edge, v):
        return 0.0
    cell = cell_at(i, ground, table, u_c, speed_terms)
    start = release if i == first else edge[i]
    return np.sqrt(travel(v[i], start, place, cell, barriers)[0])


@compiled()
def speed_tangents_at(  # type: ignore[no-untyped-def]
    place, i, release, runout, first, edge, ground, barriers, law, table, v, dv, step
):
    """As `speed_at`, with the tangents of the speed in `step`."""
    step[:] = 0.0
    if not _comes_by(place, release, runout, edge, v):
        return 0.0
    cell = cell_at(i, ground, table, law.weakening_speed, law.speed_terms)
    start = release if i == first else edge[i]
    step[:] = dv[i]
    if i == first:
        step[-1] = -slope_of_v(0.0, cell)
    end, _, _ = travel_tangents(v[i], start, place, cell, barriers, law, i, step)
    if i == first and law.speed_terms:
        step[-1] = -slope_of_v(end, cell)
    speed = np.sqrt(end)
    for k in range(step.size):
        step[k] = 0.5 * step[k] / speed if speed > 0.0 else 0.0
    return speed


@compiled()
def read(  # type: ignore[no-untyped-def]
    sensors,
    cells,
    release,
    runout,
    first,
    edge,
    ground,
    barriers,
    u_c,
    speed_terms,
    table,
    v,
    readings,
):
    """All readings [m/s or m] of one front.

    A span reads its length over the travel time, or 0 where the front stops before its lower end.
    The time over a cell is its length over the mean of the speeds at its ends: exact for a
    constant retardation, second order otherwise.
    """
    for j in range(sensors.shape[0]):
        s_from, s_to, i = sensors[j, 1], sensors[j, 2], cells[j]
        if sensors[j, 0] == RUNOUT:
            readings[j] = runout
            continue
        upper = speed_at(
            s_from, i, release, runout, first, edge, ground, barriers, u_c, speed_terms, table, v
        )
        readings[j] = upper
        if s_from == s_to:
            continue
        place, time = s_from, 0.0
        reached = s_from >= release and s_to <= runout
        while reached and place < s_to:
            ahead = min(edge[i + 1], s_to)
            lower = speed_at(
                ahead, i, release, runout, first, edge, ground, barriers, u_c, speed_terms, table, v
            )
            time += 2.0 * (ahead - place) / (upper + lower)
            upper, place = lower, ahead
            i += 1
        readings[j] = (s_to - s_from) / time if reached else 0.0


@compiled()
def read_tangents(  # type: ignore[no-untyped-def]
    sensors,
    cells,
    release,
    runout,
    first,
    edge,
    ground,
    barriers,
    law,
    table,
    v,
    dv,
    d_runout,
    tangents,
):
    """Tangents of all readings of one front, (n_sensors, n_tangents); see `read`."""
    step, d_upper = np.zeros(d_runout.size), np.zeros(d_runout.size)
    d_time = np.zeros(d_runout.size)
    for j in range(sensors.shape[0]):
        s_from, s_to, i = sensors[j, 1], sensors[j, 2], cells[j]
        if sensors[j, 0] == RUNOUT:
            tangents[j] = d_runout
            continue
        upper = speed_tangents_at(
            s_from, i, release, runout, first, edge, ground, barriers, law, table, v, dv, step
        )
        tangents[j] = step
        if s_from == s_to:
            continue
        tangents[j] = 0.0
        d_upper[:] = step
        d_time[:] = 0.0
        place, time = s_from, 0.0
        reached = s_from >= release and s_to <= runout
        while reached and place < s_to:
            ahead = min(edge[i + 1], s_to)
            lower = speed_tangents_at(
                ahead, i, release, runout, first, edge, ground, barriers, law, table, v, dv, step
            )
            both, length = upper + lower, ahead - place
            time += 2.0 * length / both
            d_time -= 2.0 * length * (d_upper + step) / (both * both)
            d_upper[:] = step
            upper, place = lower, ahead
            i += 1
        if reached:
            tangents[j] = -(s_to - s_from) * d_time / (time * time)
