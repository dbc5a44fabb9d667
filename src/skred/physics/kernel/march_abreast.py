"""The march with terms in U: some fronts abreast, cell after cell, because each waits for its own last cell.

In each cell the terms in U are frozen at the mean speed of the stretch (see `cell.end_speed`), and the
speed at its end is solved for: here by Newton's method from what the cells before let expect, two steps as
a rule. One front alone would wait for every division; of fronts side by side many are under way at once, and
the compiler makes vectors of them. Where something happens to a front, or its cell is not quickly solved,
it is left to `march.travel`: the same equation, its solution enclosed.
"""

from __future__ import annotations

import numpy as np

from skred.parallel.compile_cache import inner
from skred.physics.kernel.cell import SERIES_LIMIT, WEAKENING, Cell, phi1_series
from skred.physics.kernel.columns import Column
from skred.physics.kernel.inputs import cell_of
from skred.physics.kernel.march import travel
from skred.physics.kernel.scaled_ground import BEND, DOUBLE, DRIVE, WEIGHT

ABREAST = 16
"""Fronts side by side."""
# One array at constant distances, so that the compiler sees that rows do not overlap: first the columns of
# the coefficient table, in their order, then the fronts' state.
_CONSTANT, _LINEAR, _QUADRATIC, _FRICTION, _WEAKENING = (ABREAST * int(column) for column in Column)
_U, _V, _GAINED, _BEFORE, _GOING, _CARRIED, _BY_MEAN, _BY_WEAKENING, _AHEAD, _SOLVED = (
    ABREAST * (len(Column) + row) for row in range(10)
)
_N_COLUMNS, _N_ROWS = len(Column), len(Column) + 10
_STEPS, _NEAR = 6, 5e-8
_LEAST_SHARE = 0.5
"""Share of the speed below which a cell would slow a front so much that the first guess is no guess."""


@inner()
def cells_alike(profiles):  # type: ignore[no-untyped-def]
    """Whether the strengths enter each cell as they enter the one above it."""
    alike = np.ones(profiles.shape[1], dtype=np.bool_)
    alike[0] = False
    for k in range(profiles.shape[0]):
        for i in range(1, alike.size):
            alike[i] &= profiles[k, i] == profiles[k, i - 1]
    return alike


@inner(fastmath={"contract"})
def _fill_coefficients(i, strengths, columns, profiles, work):  # type: ignore[no-untyped-def]
    """Each front's row of the coefficient table at cell i; strengths are (n_strengths, ABREAST)."""
    work[: _N_COLUMNS * ABREAST] = 0.0
    for k in range(columns.size):
        profile, first = profiles[k, i], np.uint64(ABREAST * columns[k])
        if profile != 0.0:
            for j in range(np.uint64(ABREAST)):
                work[first + j] += strengths[np.uint64(k), j] * profile


@inner(fastmath={"contract"})
def _begin(drive, weight, bend, double, limit, work):  # type: ignore[no-untyped-def]
    """What a cell makes of each front without and with terms in U, and a first guess of its speed ahead."""
    for j in range(ABREAST):
        x = double * work[_QUADRATIC + j] + bend * work[_FRICTION + j]
        p = phi1_series(x)
        source = drive - weight * work[_FRICTION + j] - double * work[_CONSTANT + j]
        work[_CARRIED + j] = (1.0 - x * p) * work[_V + j] + source * p
        work[_BY_MEAN + j] = -double * p * work[_LINEAR + j]
        work[_BY_WEAKENING + j] = -weight * p * work[_WEAKENING + j]
        # As if the speed went on as it did in the two cells before.
        ahead = work[_U + j] + work[_GAINED + j] + (work[_GAINED + j] - work[_BEFORE + j])
        work[_AHEAD + j] = ahead
        usual = (work[_GOING + j] > 0.0) & (0.0 < work[_V + j]) & (work[_V + j] <= limit)
        usual &= (abs(x) <= SERIES_LIMIT) & (ahead > _LEAST_SHARE * work[_U + j])
        work[_GOING + j] = 1.0 if usual else 0.0
        work[_SOLVED + j] = 0.0


@inner(fastmath={"contract"})
def _improve(weakens, per_scale, work):  # type: ignore[no-untyped-def]
    """One of Newton's steps; returns how many of the fronts that are going are not solved yet."""
    left_over = 0
    for j in range(ABREAST):
        u0, u1, v0 = work[_U + j], work[_AHEAD + j], work[_V + j]
        per_total = 1.0 / (1.5 * (u0 + u1))
        mean = (v0 + u0 * u1 + u1 * u1) * per_total
        excess = work[_CARRIED + j] + work[_BY_MEAN + j] * mean - u1 * u1
        by_mean = work[_BY_MEAN + j]
        if weakens:
            relative = 1.0 / (1.0 + mean * per_scale)
            excess += work[_BY_WEAKENING + j] * relative
            by_mean -= work[_BY_WEAKENING + j] * relative * relative * per_scale
        left = 2.0 * u1 - by_mean * (2.0 * u1 + u0 - 1.5 * mean) * per_total
        # Else it is close to where there are two solutions, or none.
        going = (work[_GOING + j] > 0.0) & (left > u1)
        # What this step leaves goes with the square of the excess: it is below rounding.
        solved = going & (abs(excess) <= _NEAR * v0)
        work[_AHEAD + j] = u1 + excess / left if going & (work[_SOLVED + j] == 0.0) else u1
        work[_GOING + j] = 1.0 if going else 0.0
        work[_SOLVED + j] = 1.0 if solved else work[_SOLVED + j]
        left_over += 1 if going & (work[_SOLVED + j] == 0.0) else 0
    return left_over


@inner()
def _cell_of_front(i, j, ground, u_c, work):  # type: ignore[no-untyped-def]
    """Cell i as `cell.cell_at` has it, for the front in place j."""
    return Cell(
        ground[0, i], ground[1, i], ground[2, i],
        work[_CONSTANT + j], work[_LINEAR + j], work[_QUADRATIC + j], work[_FRICTION + j],
        work[_WEAKENING + j], u_c, True,
    )  # fmt: skip


@inner()
def march_abreast(  # type: ignore[no-untyped-def]
    run, strengths, releases, start_v, edge, ground, scaled, barriers, limits, columns, profiles, alike,
    u_c, own, work, v, runout, last, first,
):  # fmt: skip
    """The fronts from `run` on, as many as go abreast or are left.

    Fills v (ABREAST, n_cells + 1) at every edge and, (ABREAST,) each, the runout [m], the last cell entered
    and the cell of the release, at whose upper edge v is what the front starts with. `alike` (n_cells,) is by
    `cells_alike`; `own` (n_strengths, ABREAST) and `work` are for its own use, see `room`.
    """
    n, n_cells = min(ABREAST, releases.size - run), ground.shape[1]
    weakens, per_scale = False, 1.0 / u_c
    for k in range(columns.size):
        weakens |= columns[k] == WEAKENING
    for j in range(ABREAST):
        # What is not there goes with the last that is, and does not count.
        for k in range(columns.size):
            own[k, j] = strengths[run + min(j, n - 1), k]
    v[:] = 0.0
    work[:] = 0.0
    begin = n_cells
    for j in range(n):
        first[j], last[j], runout[j] = cell_of(edge, releases[run + j]), n_cells - 1, edge[n_cells]
        v[j, first[j]] = work[_V + j] = start_v[run + j]
        work[_U + j] = np.sqrt(start_v[run + j])
        begin = min(begin, first[j])
    under_way = n
    for i in range(begin, n_cells):
        if i == begin or not alike[i]:
            _fill_coefficients(i, own, columns, profiles, work)
        for j in range(n):
            at_edge = i > first[j] or releases[run + j] == edge[i]
            work[_GOING + j] = 1.0 if at_edge and i <= last[j] else 0.0
        _begin(scaled[DRIVE, i], scaled[WEIGHT, i], scaled[BEND, i], scaled[DOUBLE, i], limits[i], work)
        for _ in range(_STEPS):
            if _improve(weakens, per_scale, work) == 0:
                break
        for j in range(n):
            if not first[j] <= i <= last[j]:
                continue
            u0, u1 = work[_U + j], work[_AHEAD + j]
            if work[_SOLVED + j] > 0.0 and u1 > _LEAST_SHARE * u0 and u1 * u1 <= limits[i + 1]:
                work[_BEFORE + j], work[_GAINED + j] = work[_GAINED + j], u1 - u0
                work[_U + j], work[_V + j] = u1, u1 * u1
                v[j, i + 1] = u1 * u1
                continue
            cell, end = _cell_of_front(i, j, ground, u_c, work), edge[i + 1]
            start = releases[run + j] if i == first[j] else edge[i]
            v1, s, stopped, _ = travel(work[_V + j], start, end, end, np.inf, cell, barriers)
            if stopped:
                runout[j], last[j], under_way = s, i, under_way - 1
                work[_U + j] = work[_V + j] = 0.0
                continue
            v[j, i + 1] = work[_V + j] = v1
            work[_U + j], work[_GAINED + j], work[_BEFORE + j] = np.sqrt(v1), 0.0, 0.0
        if under_way == 0:
            break


@inner()
def room(n_strengths, n_cells):  # type: ignore[no-untyped-def]
    """What `march_abreast` writes in: own, work, v, runout, last, first."""
    return (
        np.empty((n_strengths, ABREAST)),
        np.empty(_N_ROWS * ABREAST),
        np.empty((ABREAST, n_cells + 1)),
        np.empty(ABREAST),
        np.empty(ABREAST, dtype=np.int64),
        np.empty(ABREAST, dtype=np.int64),
    )
