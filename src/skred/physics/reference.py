"""The front's equation of motion in plain Python: the second route beside the fast kernel.

A run is a chain of pieces. In each the equation is linear in v = U^2,

    dv/ds = forcing - decay v,

with constant coefficients, so speeds, switches and stops follow in closed form. Retardation that
depends on U itself (linear drag, weakening friction) is frozen at the piece's mean speed: second order.
Everything is complex inside, so that one complex step in any input gives an exact derivative.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skred.physics.kernel.columns import GRAVITY
from skred.physics.terrain import Terrain

Barrier = tuple[float, float, complex]
"""Place [m], height [m], loss of those that pass [J/kg]."""
Sensor = tuple[str, float, float]
"""``"point"``, ``"span"``, ``"span to stop"`` or ``"runout"``; from and to [m]
(equal for a point, unused for runout)."""


class Cell(NamedTuple):
    """One cell: slope, curvature [1/m] and its column of the coefficient table."""

    sin_slope: float
    cos_slope: float
    curvature: float
    constant: complex
    linear: complex
    quadratic: complex
    friction: complex
    weakening: complex
    weakening_speed: float


class Piece(NamedTuple):
    """Part of a cell with constant coefficients: dv/ds = forcing - decay v from ``start_v``."""

    start_s: complex
    end_s: complex
    start_v: complex
    forcing: complex
    decay: complex

    def speed_squared(self, s: complex) -> complex:
        """Return v [m2/s2] at ``s`` [m]."""
        length = s - self.start_s
        rate = self.forcing - self.decay * self.start_v
        return self.start_v + rate * length * _mean_decay(self.decay * length)

    def place_of(self, v: complex) -> complex:
        """Return the place [m] at which the speed squared is ``v``."""
        rate = self.forcing - self.decay * self.start_v
        straight = (v - self.start_v) / rate
        return self.start_s + straight * _log_ratio(self.decay * straight)


@dataclass(frozen=True, eq=False)
class FrontRun:
    """One front's way down the track.

    Attributes
    ----------
    edge_speed_squared : (n_cells + 1,) array, m2/s2
        v at the cell edges, behind a barrier that stands there; 0 above the release and below the stop.
    runout_s_m : float or complex, m
        Place of the stop, or the end of the track.
    left_track : bool
        Whether the front was still moving there.
    pieces : tuple of Piece
        The run itself.

    """

    edge_speed_squared: NDArray[Any]
    runout_s_m: Any
    left_track: bool
    pieces: tuple[Piece, ...]

    def speed(self, s: float) -> complex:
        """Return the speed [m/s] on arrival at ``s`` [m]; 0 where the front did not come."""
        if not self.pieces or not self.pieces[0].start_s.real <= s <= self.runout_s_m.real:
            return 0j
        piece = next((p for p in self.pieces if p.end_s.real >= s), self.pieces[-1])
        return _speed(piece.speed_squared(s))

    def span_speed(self, s_from: float, s_to: float, *, to_stop: bool = False) -> complex:
        """Return length over travel time [m/s]; 0 where the front did not cover the whole span.

        With `to_stop`, of the part that it covered.
        """
        if not self.pieces or s_from < self.pieces[0].start_s.real:
            return 0j
        last: complex = s_to
        if s_to > self.runout_s_m.real:
            if not to_stop or s_from >= self.runout_s_m.real:
                return 0j
            last = self.runout_s_m
        time = 0j
        for piece in self.pieces:
            start = piece.start_s if piece.start_s.real > s_from else s_from
            end = piece.end_s if piece.end_s.real < s_to else s_to
            if end.real > start.real:
                at_end = piece.speed_squared(end)
                if end == self.runout_s_m and abs(at_end) < 1e-9 * abs(piece.speed_squared(start)):
                    at_end = 0j  # at rest, but for rounding
                time += (end - start) / ((_speed(piece.speed_squared(start)) + _speed(at_end)) / 2)
        return (last - s_from) / time


def run_front(
    terrain: Terrain,
    table: ArrayLike,
    release_s_m: complex,
    *,
    weakening_speed: float = math.inf,
    barriers: Sequence[Barrier] = (),
    release_speed: complex = 0.0,
) -> FrontRun:
    """Send one front down the track.

    Parameters
    ----------
    terrain : Terrain
        Cells with edges [m], slope and curvature [1/m].
    table : (5, n_cells) array, real or complex
        Coefficients in the order and units of ``Column``.
    release_s_m : float or complex, m
        Where the front starts. A barrier above it is not met, nor is one there by a front at rest.
    weakening_speed : float, m/s
        U_c of weakening friction.
    barriers : sequence of (s [m], height [m], loss [J/kg]), sorted by s
        A front with v < 2 g height, or no more than 2 loss, stops; others go on with v - 2 loss.
    release_speed : float or complex, m/s
        How fast the front is where it starts; 0 from rest.

    Returns
    -------
    FrontRun
        Complex where the table, the release point or a loss is.

    Raises
    ------
    ValueError
        If the release point does not lie on the track.

    """
    coefficients = np.asarray(table)
    dtype = np.result_type(
        coefficients, release_s_m, release_speed, *(loss for _, _, loss in barriers), np.float64
    )
    edge_v = np.zeros(len(terrain.edge_s_m), dtype=complex)
    s, v, moving = complex(release_s_m), complex(release_speed) ** 2, False
    edge_v[terrain.edge_s_m == s.real] = v
    pieces: list[Piece] = []
    for index, end_s, barrier in _sections(terrain.edge_s_m, s.real, barriers, v.real > 0):
        cell = _cell(terrain, coefficients, index, weakening_speed)
        if not pieces and v == 0 and _coefficients(cell, True, 0j)[0].real <= 0:
            break
        pieces += _cross(cell, s, end_s, v)
        s, v = pieces[-1].end_s, pieces[-1].speed_squared(pieces[-1].end_s)
        moving = s == end_s and v.real > 0
        if moving and barrier is not None:
            _, height, loss = barrier
            moving = v.real >= 2 * GRAVITY * height and (v - 2 * loss).real > 0
            v -= 2 * loss
        if not moving:
            break
        if end_s == terrain.edge_s_m[index + 1]:
            edge_v[index + 1] = v
    if dtype.kind == "c":
        return FrontRun(edge_v, complex(s), moving, tuple(pieces))
    return FrontRun(edge_v.real, s.real, moving, tuple(pieces))


def read_front(
    terrain: Terrain,
    table: ArrayLike,
    release_s_m: complex,
    sensors: Sequence[Sensor],
    *,
    weakening_speed: float = math.inf,
    barriers: Sequence[Barrier] = (),
    release_speed: complex = 0.0,
) -> NDArray[Any]:
    """Run a front as `run_front` does and read it at the sensors.

    Returns
    -------
    (n_sensors,) array
        Speed at a point, mean speed over a span [m/s], or runout as s [m].

    """
    run = run_front(
        terrain,
        table,
        release_s_m,
        weakening_speed=weakening_speed,
        barriers=barriers,
        release_speed=release_speed,
    )
    readings = np.zeros(len(sensors), dtype=complex)
    for index, (kind, s_from, s_to) in enumerate(sensors):
        if kind == "runout":
            readings[index] = run.runout_s_m
        elif kind == "point":
            readings[index] = run.speed(s_from)
        elif kind in ("span", "span to stop"):
            readings[index] = run.span_speed(s_from, s_to, to_stop=kind == "span to stop")
        else:
            raise ValueError(f"sensor {index}: expected point, span, span to stop or runout, found {kind!r}")
    return readings if isinstance(run.runout_s_m, complex) else readings.real


def _sections(
    edge_s: NDArray[np.float64], release_s: float, barriers: Sequence[Barrier], moving: bool
) -> Iterator[tuple[int, float, Barrier | None]]:
    """Cell, lower end [m] and the barrier there, for every stretch between edges and barriers."""
    if not edge_s[0] <= release_s <= edge_s[-1]:
        raise ValueError(f"release at {release_s} m, but the track runs from {edge_s[0]} to {edge_s[-1]} m")
    first = int(np.searchsorted(edge_s, release_s, side="right")) - 1
    if moving:  # over the track's end as well
        first = min(first, len(edge_s) - 2)
    for index in range(first, len(edge_s) - 1):
        upper, lower = max(release_s, edge_s[index]), float(edge_s[index + 1])
        for barrier in barriers:
            if upper < barrier[0] <= lower or (moving and barrier[0] == release_s == upper):
                yield index, barrier[0], barrier
        yield index, lower, None


def _cell(terrain: Terrain, table: NDArray[Any], index: int, weakening_speed: float) -> Cell:
    sin_slope, cos_slope = float(terrain.sin_slope[index]), float(terrain.cos_slope[index])
    b, c, d, mu, w = (complex(value) for value in table[:, index])
    return Cell(sin_slope, cos_slope, float(terrain.curvature[index]), b, c, d, mu, w, weakening_speed)


def _cross(cell: Cell, s: complex, end_s: complex, v: complex) -> list[Piece]:
    """Cross the cell to ``end_s`` or to the stop, in two pieces where the normal force switches."""
    contact = GRAVITY * cell.cos_slope + cell.curvature * v.real >= 0
    piece = _piece(cell, contact, s, end_s, v)
    pieces = [piece]
    switch_v = -GRAVITY * cell.cos_slope / cell.curvature if cell.curvature < 0 else math.inf
    if (piece.speed_squared(end_s).real > switch_v) == contact:
        switch_s = piece.place_of(switch_v)
        pieces = [piece._replace(end_s=switch_s), _piece(cell, not contact, switch_s, end_s, switch_v)]
    if pieces[-1].speed_squared(end_s).real <= 0:
        pieces[-1] = pieces[-1]._replace(end_s=pieces[-1].place_of(0j))
    return pieces


def _piece(cell: Cell, contact: bool, s: complex, end_s: complex, v: complex) -> Piece:
    """Freeze the terms in U at the mean speed of the piece, which depends on them in turn."""

    def excess(end: complex) -> complex:
        frozen = Piece(s, end_s, v, *_coefficients(cell, contact, _mean_speed(v, end**2)))
        return frozen.speed_squared(end_s) - end**2

    end = _end_speed(cell, contact, v, excess)
    return Piece(s, end_s, v, *_coefficients(cell, contact, _mean_speed(v, end**2)))


def _end_speed(cell: Cell, contact: bool, v: complex, excess: Callable[[complex], complex]) -> complex:
    """Return the end speed [m/s] without excess, 0 for a front that stops: bisection, then Newton's step."""
    start = _speed(v)
    if cell.linear == 0 and cell.weakening == 0:
        return start
    forcing, decay = _coefficients(cell, contact, start)
    low, high = 0.0, start.real
    if (forcing - decay * v).real > 0:
        low, high = high, high + 1.0
        while excess(high).real > 0:
            high = 2 * high
    elif excess(0j).real <= 0:
        return 0j
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle).real > 0 else (low, middle)
    step = 1e-6 * high
    slope = (excess(high + step) - excess(high - step)).real / (2 * step)
    return high - excess(high) / slope


def _coefficients(cell: Cell, contact: bool, speed: complex) -> tuple[complex, complex]:
    """Return forcing [m/s2] and decay [1/m] of dv/ds = forcing - decay v at the given U [m/s]."""
    weakened = cell.weakening / (1 + speed / cell.weakening_speed)
    friction = cell.friction if contact else 0.0
    driving = GRAVITY * cell.sin_slope - cell.constant - cell.linear * speed
    retarding = (friction + weakened) * GRAVITY * cell.cos_slope
    return 2 * (driving - retarding), 2 * (cell.quadratic + friction * cell.curvature)


def _speed(v: complex) -> complex:
    return cmath.sqrt(v) if v.real > 0 else 0j


def _mean_speed(start_v: complex, end_v: complex) -> complex:
    """Mean of U over a length in which v changes linearly (to 0 where it would become negative)."""
    start, end = _speed(start_v), _speed(end_v)
    if start + end == 0:
        return 0j
    return 2 / 3 * (start**2 + start * end + end**2) / (start + end)


def _mean_decay(z: complex) -> complex:
    """(1 - exp(-z)) / z, by its series where the difference would cancel."""
    if abs(z) > 0.1:
        return (1 - cmath.exp(-z)) / z
    value = 1 + 0j
    for k in range(12, 1, -1):
        value = 1 - z / k * value
    return value


def _log_ratio(z: complex) -> complex:
    """-log(1 - z) / z, by its series where the quotient would cancel."""
    if abs(z) > 0.1:
        return -cmath.log(1 - z) / z
    return sum(z**k / (k + 1) for k in range(18))
