"""Reading a front as the instruments do: speed at a point, mean speed over a span, runout."""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.cell import CONSTANT, FRICTION, QUADRATIC, cell_at, phi1, psi, step_v
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.inputs import RUNOUT, VELOCITY_TO_STOP, cell_of
from skred.physics.kernel.march import (
    contact_law,
    is_regular,
    regular_until,
    start_tangents,
    travel,
    travel_tangents,
)

_SUMS = {"contract", "nsz", "reassoc"}
_ONE = np.uint64(1)


@inner()
def speed_at(  # type: ignore[no-untyped-def]
    place, i, release, runout, first, edge, ground, barriers, u_c, speed_terms, table, v
):
    """Front speed [m/s] on arrival at a place in cell i; 0 where the front does not come."""
    if not release <= place <= runout:
        return 0.0
    cell = cell_at(i, ground, table, u_c, speed_terms)
    start = release if i == first else edge[i]
    return np.sqrt(travel(v[i], start, place, edge[i + 1], np.inf, cell, barriers)[0])


@inner()
def span_end(quantity, s_from, s_to, release, runout):  # type: ignore[no-untyped-def]
    """Where the part of a span ends over which the front is timed; `s_from` if it is not timed at all."""
    if s_from < release or (s_to > runout and quantity != VELOCITY_TO_STOP):
        return s_from
    return max(min(s_to, runout), s_from)


@inner(fastmath=_SUMS)
def _time_over(i, last, edge, v):  # type: ignore[no-untyped-def]
    """Time [s] over whole cells from i to before `last`, in which nothing happens."""
    time, above = 0.0, np.uint64(i)
    for k in range(last - i):  # not from i to `last`: only a loop from 0 on is vectorised
        cell = above + np.uint64(k)
        time += (edge[cell + _ONE] - edge[cell]) / (np.sqrt(v[cell]) + np.sqrt(v[cell + _ONE]))
    return 2.0 * time


@inner()
def _speed_in(place, i, edge, ground, table, v):  # type: ignore[no-untyped-def]
    """Speed [m/s] at a place of cell i, in which nothing happens."""
    a, b = contact_law(i, ground, table)
    return np.sqrt(max(step_v(v[i], place - edge[i], a, b), 0.0))


@inner()
def _regular_time(s_from, s_to, i, last, edge, ground, table, v):  # type: ignore[no-untyped-def]
    """Time [s] from a place in cell i to one in cell `last`, if nothing happens in these or between them."""
    u0, u1 = _speed_in(s_from, i, edge, ground, table, v), _speed_in(s_to, last, edge, ground, table, v)
    if last == i:
        return 2.0 * (s_to - s_from) / (u0 + u1)
    begun = 2.0 * (edge[i + 1] - s_from) / (u0 + np.sqrt(v[i + 1]))
    ended = 2.0 * (s_to - edge[last]) / (np.sqrt(v[last]) + u1)
    return begun + _time_over(i + 1, last, edge, v) + ended


@inner()
def _whole_until(i, first, s_from, whole_to, limits, edge, v):  # type: ignore[no-untyped-def]
    """Where the cells from i on end that lie wholly within a span and in which nothing happens."""
    return regular_until(i, whole_to, limits, v) if i > first and edge[i] >= s_from else i


@inner()
def span_speed(  # type: ignore[no-untyped-def]
    s_from, s_to, end, i, release, first, edge, ground, barriers, limits, u_c, speed_terms, table, v
):  # fmt: skip
    """Mean speed [m/s] from `s_from`, in cell i, to `end`: length over travel time; 0 for no length.

    `end` is `s_to` or a stop above it.

    The time over a cell, or the part of one in which nothing changes, is its length over the mean
    of the speeds at its ends: exact for a constant retardation, second order otherwise.
    """
    if end <= s_from:
        return 0.0
    time, whole_to = 0.0, cell_of(edge, end)
    if i > first and not speed_terms and regular_until(i, whole_to + 1, limits, v) > whole_to:
        return (end - s_from) / _regular_time(s_from, end, i, whole_to, edge, ground, table, v)
    while i < edge.size - 1 and edge[i] < end:
        last = _whole_until(i, first, s_from, whole_to, limits, edge, v)
        if last > i:
            time += _time_over(i, last, edge, v)
            i = last
            continue
        cell = cell_at(i, ground, table, u_c, speed_terms)
        start = release if i == first else edge[i]
        ahead = min(edge[i + 1], s_to)  # not `end`: a stop is to be met, not to be rounded to
        time += travel(v[i], start, ahead, edge[i + 1], s_from, cell, barriers)[3]
        i += 1
    return (end - s_from) / time


@inner()
def read(  # type: ignore[no-untyped-def]
    run, sensors, cells, release, runout, first, edge, ground, barriers, limits, u_c, speed_terms,
    table, v, readings,
):  # fmt: skip
    """All readings [m/s or m] of one front, into one row."""
    for j in range(sensors.shape[0]):
        s_from, s_to, i = sensors[j, 1], sensors[j, 2], cells[j]
        if sensors[j, 0] == RUNOUT:
            readings[run, j] = runout
        elif (
            s_from == s_to
            and i > first
            and not speed_terms
            and v[i] <= limits[i]
            and 0.0 < v[i + 1] <= limits[i + 1]
        ):
            # Written out: handing arrays to a function costs more than this, in counted references.
            mu = table[FRICTION, i]
            a = 2.0 * (GRAVITY * (ground[0, i] - mu * ground[1, i]) - table[CONSTANT, i])
            b = 2.0 * (table[QUADRATIC, i] + mu * ground[2, i])
            length = s_from - edge[i]
            readings[run, j] = np.sqrt(max(v[i] + (a - b * v[i]) * length * phi1(b * length), 0.0))
        elif s_from == s_to:
            readings[run, j] = speed_at(
                s_from, i, release, runout, first, edge, ground, barriers, u_c, speed_terms, table, v
            )
        else:
            end = span_end(sensors[j, 0], s_from, s_to, release, runout)
            readings[run, j] = span_speed(
                s_from, s_to, end, i, release, first, edge, ground, barriers, limits, u_c, speed_terms,
                table, v,
            )  # fmt: skip


@inner()
def _regular_speed_tangents(  # type: ignore[no-untyped-def]
    speed, length, i, ground, table, columns, profiles, v, dv, tangents
):
    """Tangents of `speed`, `length` metres into a cell in which nothing happens."""
    a, b = contact_law(i, ground, table)
    x = b * length
    by_source = 2.0 * length * phi1(x)
    keep = 1.0 - 0.5 * b * by_source
    by_decay = 2.0 * length * (keep * v[i] + a * length * psi(x))
    for k in range(tangents.size):
        change = keep * dv[k, i]
        if k < columns.size:
            if columns[k] == CONSTANT:
                change -= by_source * profiles[k, i]
            elif columns[k] == QUADRATIC:
                change -= by_decay * profiles[k, i]
            else:
                friction = GRAVITY * ground[1, i] * by_source + ground[2, i] * by_decay
                change -= friction * profiles[k, i]
        tangents[k] = 0.5 * change / speed


@inner(fastmath=_SUMS)
def _time_tangents(i, last, edge, v, dv, d_time):  # type: ignore[no-untyped-def]
    """Tangents of the time over whole cells from i to before `last`, added to `d_time`."""
    above = np.uint64(i)
    for k in range(d_time.size):
        change = 0.0
        for one in range(last - i):
            cell = above + np.uint64(one)
            u0, u1 = np.sqrt(v[cell]), np.sqrt(v[cell + _ONE])
            by_mean = (edge[cell + _ONE] - edge[cell]) / ((u0 + u1) * (u0 + u1))
            change += by_mean * (dv[k, cell] / u0 + dv[k, cell + _ONE] / u1)
        d_time[k] -= change


@inner()
def _regular_time_tangents(  # type: ignore[no-untyped-def]
    s_from, s_to, i, last, edge, ground, table, columns, profiles, v, dv, du0, du1, d_time
):
    """Tangents of `_regular_time`, added to `d_time`; those of the speeds at both ends go to du0 and du1."""
    u0, u1 = _speed_in(s_from, i, edge, ground, table, v), _speed_in(s_to, last, edge, ground, table, v)
    _regular_speed_tangents(u0, s_from - edge[i], i, ground, table, columns, profiles, v, dv, du0)
    _regular_speed_tangents(u1, s_to - edge[last], last, ground, table, columns, profiles, v, dv, du1)
    if last == i:
        by_mean = 2.0 * (s_to - s_from) / ((u0 + u1) * (u0 + u1))
        for k in range(d_time.size):
            d_time[k] -= by_mean * (du0[k] + du1[k])
        return
    below, above = np.sqrt(v[i + 1]), np.sqrt(v[last])
    begun = 2.0 * (edge[i + 1] - s_from) / ((u0 + below) * (u0 + below))
    ended = 2.0 * (s_to - edge[last]) / ((above + u1) * (above + u1))
    for k in range(d_time.size):
        d_time[k] -= begun * (du0[k] + 0.5 * dv[k, i + 1] / below)
        d_time[k] -= ended * (du1[k] + 0.5 * dv[k, last] / above)
    _time_tangents(i + 1, last, edge, v, dv, d_time)


@inner()
def _span_tangents(  # type: ignore[no-untyped-def]
    s_from, s_to, i, speed, release, runout, first, edge, ground, barriers, limits, u_c, speed_terms, columns,
    profiles, table, v, dv, step, shift, d_time, d_runout, tangents,
):  # fmt: skip
    """Tangents of a span's mean speed, which is `speed`."""
    end = min(s_to, runout)
    whole_to = cell_of(edge, end)
    d_time[:] = 0.0
    regular = i > first and not speed_terms and regular_until(i, whole_to + 1, limits, v) > whole_to
    if regular:
        _regular_time_tangents(
            s_from, end, i, whole_to, edge, ground, table, columns, profiles, v, dv, step, shift, d_time
        )
    while not regular and i < edge.size - 1 and edge[i] < end:
        last = _whole_until(i, first, s_from, whole_to, limits, edge, v)
        if last > i:
            _time_tangents(i, last, edge, v, dv, d_time)
            i = last
            continue
        start = start_tangents(i, first, release, columns.size, v, edge, dv, step, shift)
        cell, ahead = cell_at(i, ground, table, u_c, speed_terms), min(edge[i + 1], s_to)
        travel_tangents(
            v[i], start, ahead, edge[i + 1], s_from, cell, barriers, columns, profiles, i,
            step, shift, d_time,
        )  # fmt: skip
        i += 1
    for k in range(tangents.size):
        d_end = d_runout[k] if runout < s_to else 0.0
        tangents[k] = speed * (d_end - speed * d_time[k]) / (end - s_from)


@inner()
def read_tangents(  # type: ignore[no-untyped-def]
    run, sensors, cells, release, runout, first, edge, ground, barriers, limits, columns, profiles,
    u_c, speed_terms, table, v, dv, step, shift, d_time, d_runout, readings, jacobian,
):  # fmt: skip
    """Tangents of all readings of one front, into jacobian[run] (n_sensors, n_tangents)."""
    for j in range(sensors.shape[0]):
        s_from, s_to, i, tangents = sensors[j, 1], sensors[j, 2], cells[j], jacobian[run, j]
        speed = readings[run, j]
        if sensors[j, 0] == RUNOUT:
            for k in range(tangents.size):
                tangents[k] = d_runout[k]
        elif not speed > 0.0:
            tangents[:] = 0.0
        elif s_from < s_to:
            _span_tangents(
                s_from, s_to, i, speed, release, runout, first, edge, ground, barriers, limits, u_c,
                speed_terms, columns, profiles, table, v, dv, step, shift, d_time, d_runout, tangents,
            )  # fmt: skip
        elif not speed_terms and is_regular(i, first, limits, v):
            _regular_speed_tangents(
                speed, s_from - edge[i], i, ground, table, columns, profiles, v, dv, tangents
            )
        else:
            start = start_tangents(i, first, release, columns.size, v, edge, dv, step, shift)
            cell = cell_at(i, ground, table, u_c, speed_terms)
            travel_tangents(
                v[i], start, s_from, edge[i + 1], np.inf, cell, barriers, columns, profiles, i,
                step, shift, d_time,
            )  # fmt: skip
            for k in range(tangents.size):
                tangents[k] = 0.5 * step[k] / speed
