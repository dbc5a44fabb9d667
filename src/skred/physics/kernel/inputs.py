"""What the kernel is given: a path, the contributions of a law, and sensors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.parallel.compile_cache import compiled, inner
from skred.physics.kernel.columns import GRAVITY, Column

FRONT_VELOCITY, RUNOUT, VELOCITY_TO_STOP = 0.0, 1.0, 2.0
"""Codes of a sensor's quantity in the sensor table.

The last is a span's mean speed up to the stop of a front that stops inside, where FRONT_VELOCITY
is 0: continuous in the strengths, for likelihoods that take the stop itself into account.
"""

_LINEAR, _WEAKENING = int(Column.LINEAR), int(Column.WEAKENING)


class Path(NamedTuple):
    """Geometry of the track, made by `make_path`.

    Attributes
    ----------
    edge : (n_cells + 1,) array, m
        Arc length at the cell edges.
    ground : (3, n_cells) array
        Sine and cosine of the slope, curvature [1/m].
    barriers : (n_barriers, 3) array
        Place [m], height [m] and loss [J/kg], in order of place.
    limits : (n_cells + 1,) array, m2 s-2
        Largest v at each edge with which the recursion may pass its cells.

    """

    edge: NDArray[np.float64]
    ground: NDArray[np.float64]
    barriers: NDArray[np.float64]
    limits: NDArray[np.float64]


class Contributions(NamedTuple):
    """How strengths enter the coefficient table, made by `make_contributions`.

    Attributes
    ----------
    columns : (n_strengths,) integer array
        The `Column` that each strength enters.
    profiles : (n_strengths, n_cells) array
        Its contribution per unit of strength.
    weakening_speed : float, m/s
        Speed scale U_c of weakening friction.
    speed_terms : bool
        Whether any strength enters with U itself (no closed form then).

    """

    columns: NDArray[np.int64]
    profiles: NDArray[np.float64]
    weakening_speed: float
    speed_terms: bool


@inner()
def cell_of(edge, s):  # type: ignore[no-untyped-def]
    """Index of the cell that holds the place s (the lower one at an edge)."""
    return min(max(np.searchsorted(edge, s, side="right") - 1, 0), edge.size - 2)


@compiled()
def make_path(edge, ground, barriers):  # type: ignore[no-untyped-def]
    """Path from its arrays.

    A convex cell limits v at both its edges to the value at which the normal force vanishes;
    a cell with a barrier gets -1, so that no front passes it unlooked at.
    """
    n_cells = ground.shape[1]
    limits = np.full(n_cells + 1, np.inf)
    for i in range(n_cells):
        if ground[2, i] < 0.0:
            threshold = -GRAVITY * ground[1, i] / ground[2, i]
            limits[i] = min(limits[i], threshold)
            limits[i + 1] = min(limits[i + 1], threshold)
    for j in range(barriers.shape[0]):
        i = cell_of(edge, barriers[j, 0])
        limits[i] = -1.0
        limits[i + 1] = -1.0
    return Path(edge, ground, barriers, limits)


@compiled()
def make_contributions(columns, profiles, weakening_speed):  # type: ignore[no-untyped-def]
    """Contributions from their arrays."""
    speed_terms = False
    for column in columns:
        speed_terms |= column == _LINEAR or column == _WEAKENING
    return Contributions(columns, profiles, weakening_speed, speed_terms)


@inner()
def spans_of(profiles):  # type: ignore[no-untyped-def]
    """First cell in which each profile is not 0, and the one after the last, (n_strengths, 2) integers.

    A force given knot by knot has many profiles, of which two at most act in a cell.
    """
    spans = np.zeros((profiles.shape[0], 2), dtype=np.int64)
    for k in range(profiles.shape[0]):
        first, end = 0, profiles.shape[1]
        while first < end and profiles[k, first] == 0.0:
            first += 1
        while end > first and profiles[k, end - 1] == 0.0:
            end -= 1
        spans[k, 0], spans[k, 1] = first, end
    return spans
