"""The kernel: many fronts down one track, read where the sensors are, with tangents if wanted.

It knows no mechanism. A law is `Contributions`: which column of the coefficient table each
strength enters and with which profile along the track (see `columns.py` for the equation).
"""

from __future__ import annotations

import numpy as np

from skred.arrays import FloatArray
from skred.parallel.compile_cache import compiled, inner
from skred.physics.kernel.columns import Column
from skred.physics.kernel.inputs import Contributions, Path, cell_of, spans_of
from skred.physics.kernel.march import fill_increments, fill_steps, fill_table, march, march_tangents
from skred.physics.kernel.march_abreast import ABREAST, cells_alike, march_abreast, room
from skred.physics.kernel.reading import read, read_tangents
from skred.physics.kernel.scaled_ground import scale_ground

_N_COLUMNS = len(Column)


@inner()
def _cells_of(sensors, edge):  # type: ignore[no-untyped-def]
    """Cell of each sensor's upper end."""
    cells = np.zeros(sensors.shape[0], dtype=np.int64)
    for j in range(sensors.shape[0]):
        cells[j] = cell_of(edge, sensors[j, 1])
    return cells


@inner()
def _move(sensors, by, edge, moved, cells):  # type: ignore[no-untyped-def]
    """Sensors moved along the track, none beyond its ends, spans as a whole; and their cells."""
    for j in range(sensors.shape[0]):
        place = min(max(sensors[j, 1] + by[j], edge[0]), edge[-1] - (sensors[j, 2] - sensors[j, 1]))
        moved[j, 1], moved[j, 2] = place, place + (sensors[j, 2] - sensors[j, 1])
        cells[j] = cell_of(edge, place)


@compiled()
def fill_readings(  # type: ignore[no-untyped-def]
    strengths, releases, start_v, path, law, sensors, shifts, readings, jacobian, speeds
):
    """Fill the readings of many fronts, run by run; see `simulate`.

    `start_v` (n_runs,) is U^2 at the release [m2 s-2]; `shifts` has no rows where no sensor is moved. Fill
    the jacobian (n_runs, n_sensors, n_strengths + 1, or + 2 with the release's speed) and the speeds (n_runs,
    n_cells + 1) as well, unless their last axis is empty. One function for all three: with two the march
    would be compiled twice.
    """
    # Unpacked once: reading an array out of a tuple costs as much as ten cells.
    edge, ground, barriers, limits = path.edge, path.ground, path.barriers, path.limits
    columns, profiles = law.columns, law.profiles
    u_c, speed_terms = law.weakening_speed, law.speed_terms
    n_cells, n_tangents = ground.shape[1], jacobian.shape[2]
    scaled, cells = scale_ground(edge, ground), _cells_of(sensors, edge)
    spans, placed = spans_of(profiles), sensors.copy()
    table = np.zeros((_N_COLUMNS, n_cells))
    keep, gain, v = np.empty(n_cells), np.empty(n_cells), np.empty(n_cells + 1)
    alike = cells_alike(profiles[:, : n_cells if speed_terms else 1])
    own, work, rows, runouts, lasts, firsts = room(columns.size, n_cells if speed_terms else 0)
    # All that only tangents need is empty without them.
    n_rows = n_cells if n_tangents > 0 else 0
    increment, dv = np.zeros((n_tangents, n_rows)), np.zeros((n_tangents, n_rows + 1))
    by_source, by_decay, carry = np.empty(n_rows), np.empty(n_rows), np.empty(n_rows)
    mean, soften = np.zeros(n_rows), np.ones(n_rows)
    step, shift = np.zeros(n_tangents), np.zeros(n_tangents)
    d_time, d_runout = np.zeros(n_tangents), np.zeros(n_tangents)
    for run in range(releases.size):
        release = releases[run]
        fill_table(run, strengths, columns, profiles, spans, table)
        halvings = 0
        if not speed_terms or n_tangents > 0:
            halvings = fill_steps(scaled, table, keep, gain)
        if speed_terms:
            place = run % ABREAST
            if place == 0:
                march_abreast(
                    run, strengths, releases, start_v, edge, ground, scaled, barriers, limits, columns,
                    profiles, alike, u_c, own, work, rows, runouts, lasts, firsts,
                )  # fmt: skip
            for i in range(n_cells + 1):
                v[i] = rows[place, i]
            runout, last, first = runouts[place], lasts[place], firsts[place]
        else:
            runout, last, first = march(
                release, start_v[run], edge, ground, barriers, limits, table, keep, gain, v
            )
        if shifts.shape[0] > 0:
            _move(sensors, shifts[run], edge, placed, cells)
        read(
            run, placed, cells, release, runout, first, edge, ground, barriers, limits, u_c, speed_terms,
            table, v, readings,
        )  # fmt: skip
        if n_tangents > 0:
            fill_increments(
                halvings, scaled, ground, table, keep, v, columns, profiles, u_c, speed_terms,
                by_source, by_decay, mean, soften, carry, increment,
            )  # fmt: skip
            march_tangents(
                release, last, first, edge, ground, barriers, limits, columns, profiles, u_c, speed_terms,
                table, carry, v, increment, dv, step, shift, d_time, d_runout,
            )  # fmt: skip
            read_tangents(
                run, placed, cells, release, runout, first, edge, ground, barriers, limits, columns,
                profiles, u_c, speed_terms, table, v, dv, step, shift, d_time, d_runout, readings, jacobian,
            )  # fmt: skip
        if speeds.shape[1] > 0:
            for i in range(n_cells + 1):
                speeds[run, i] = np.sqrt(v[i]) if edge[i] >= release else 0.0


def simulate(
    strengths: FloatArray,
    releases: FloatArray,
    path: Path,
    law: Contributions,
    sensors: FloatArray,
    release_speeds: FloatArray | float = 0.0,
    shifts: FloatArray | None = None,
) -> FloatArray:
    """Readings of many fronts.

    Parameters
    ----------
    strengths : (n_runs, n_strengths) array
        Strength of each contribution in its own unit.
    releases : (n_runs,) array, m
        Where each front starts.
    path : Path
    law : Contributions
    sensors : (n_sensors, 3) array
        Quantity (FRONT_VELOCITY or RUNOUT), s_from and s_to [m]; equal for a point.
    release_speeds : (n_runs,) array or float, m/s
        How fast each front is there; 0 for one that starts from rest.
    shifts : (n_runs, n_sensors) array, m, optional
        How much further down each sensor stands for each front.

    Returns
    -------
    (n_runs, n_sensors) array, m/s or m
        0 for a front velocity where the front does not come.

    """
    return _filled(strengths, releases, release_speeds, path, law, sensors, shifts)[0]


def simulate_with_jacobian(
    strengths: FloatArray,
    releases: FloatArray,
    path: Path,
    law: Contributions,
    sensors: FloatArray,
    release_speeds: FloatArray | float = 0.0,
    shifts: FloatArray | None = None,
    *,
    by_speed: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """As `simulate`, with the derivatives by every strength, then by the release place.

    With `by_speed` also, last, by the speed at the release; it is 0 for a front that starts from rest.

    Returns
    -------
    readings : (n_runs, n_sensors) array
    jacobian : (n_runs, n_sensors, n_strengths + 1) array, or + 2

    """
    n_tangents = strengths.shape[1] + (2 if by_speed else 1)
    return _filled(strengths, releases, release_speeds, path, law, sensors, shifts, n_tangents)[:2]


def front_speeds(
    strengths: FloatArray,
    releases: FloatArray,
    path: Path,
    law: Contributions,
    release_speeds: FloatArray | float = 0.0,
) -> FloatArray:
    """Front speed U [m/s] at every cell edge, (n_runs, n_cells + 1); parameters as `simulate`."""
    none = np.empty((0, 3))
    return _filled(strengths, releases, release_speeds, path, law, none, n_edges=len(path.edge))[2]


def _filled(
    strengths: FloatArray,
    releases: FloatArray,
    release_speeds: FloatArray | float,
    path: Path,
    law: Contributions,
    sensors: FloatArray,
    shifts: FloatArray | None = None,
    n_tangents: int = 0,
    n_edges: int = 0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Readings, jacobian and speeds; the latter two empty unless asked for."""
    readings = np.empty((len(releases), len(sensors)))
    jacobian = np.empty((*readings.shape, n_tangents))
    speeds = np.empty((len(releases), n_edges))
    squares = np.empty(len(releases))
    squares[:] = np.square(release_speeds)
    # In this order in memory: of any other the kernel would be compiled once more.
    runs = np.ascontiguousarray(strengths), np.ascontiguousarray(releases)
    moved = np.empty((0, 0)) if shifts is None else np.ascontiguousarray(shifts)
    sensors = np.ascontiguousarray(sensors)
    fill_readings(*runs, squares, path, law, sensors, moved, readings, jacobian, speeds)
    return readings, jacobian, speeds
