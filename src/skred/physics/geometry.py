"""From terrain, mechanisms and sensors to the plain arrays the kernel reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skred.arrays import FloatArray
from skred.physics.kernel.inputs import (
    FRONT_VELOCITY,
    RUNOUT,
    VELOCITY_TO_STOP,
    Contributions,
    Path,
    make_contributions,
    make_path,
)
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.terrain import Terrain

WEAKENING_SPEED_M_S = 8.0
"""Speed scale of weakening friction where a law does not set its own [m/s]."""


def path_of(terrain: Terrain, barriers: Sequence[tuple[float, float, float]] = ()) -> Path:
    """Path of a terrain with barriers (place [m], height [m], loss [J/kg]).

    Raises
    ------
    ValueError
        If a barrier is off the track or has a negative height or loss.
    """
    table = np.array(sorted(barriers), dtype=float).reshape(-1, 3)
    if np.any(table[:, 1:] < 0) or np.any(table[:, 0] < 0) or np.any(table[:, 0] > terrain.length_m):
        raise ValueError("a barrier needs a place on the track, a height and a loss of at least 0")
    ground = np.array([terrain.sin_slope, terrain.cos_slope, terrain.curvature])
    path: Path = make_path(np.array(terrain.edge_s_m), ground, table)
    return path


def contributions_of(
    mechanisms: Sequence[Mechanism],
    terrain: Terrain,
    weakening_speed: float = WEAKENING_SPEED_M_S,
) -> Contributions:
    """How the strengths of some mechanisms, in their order, enter the coefficient table.

    Raises
    ------
    ValueError
        If one of them cannot be a part of a base law.
    """
    terms = [mechanism.term(terrain) for mechanism in mechanisms]
    columns = np.array([int(column) for column, _ in terms], dtype=np.int64)
    profiles = np.array([profile for _, profile in terms], dtype=float)
    contributions: Contributions = make_contributions(columns, profiles, float(weakening_speed))
    return contributions


def sensor_table(places: Sequence[tuple[float, float] | None], *, to_stop: bool = False) -> FloatArray:
    """Sensors as the kernel reads them: (s_from, s_to) in m for a front velocity, None for runout.

    With `to_stop` a span in which the front stops reads the mean speed up to there instead of 0.
    """
    rows = []
    for place in places:
        if place is None:
            rows.append((RUNOUT, 0.0, 0.0))
        else:
            is_span = place[0] < place[1]
            rows.append((VELOCITY_TO_STOP if to_stop and is_span else FRONT_VELOCITY, place[0], place[1]))
    return np.array(rows, dtype=float).reshape(-1, 3)
