"""Smooth profiles of U^2 along the track, one for each avalanche, from its readings and a base law.

The base law is integrated forward with the event's coefficients, and a normal process for U^2 takes up what
the readings differ from it. With dense recordings the readings decide, with sparse ones mostly the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Status
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.law import Law
from skred.physics.terrain import Terrain

FloatArray = NDArray[np.float64]
_STEPPED = 0.5
"""Least retardation assumed where a front stops [m s-2]: it turns an error of place into one of U^2."""
_LEAST_SPEED_M_S = 1.0
_ALLOWED_STOP_M = 60.0


class Balance(NamedTuple):
    """One side of the energy balance: U^2 at the readings and where the front stopped.

    Attributes
    ----------
    place : (n_events, n_sensors + 1) array, m
        Where each is read; the stop last.
    known : (n_events, n_sensors + 1) boolean array
    square : (n_events, n_sensors + 1) array, m2 s-2
        U^2, 0 at the stop and where nothing is known.
    sd : (n_events, n_sensors + 1) array, m2 s-2
        1 where nothing is known.
    """

    place: FloatArray
    known: NDArray[np.bool_]
    square: FloatArray
    sd: FloatArray


@dataclass(frozen=True, eq=False)
class Ride:
    """Speeds squared along the cells of the track, (n_events, n_cells + 1), 0 before and after the ride."""

    square: FloatArray

    @cached_property
    def middle(self) -> FloatArray:
        """In the middle of each cell, (n_events, n_cells)."""
        return np.asarray(0.5 * (self.square[:, 1:] + self.square[:, :-1]))

    def at(self, terrain: Terrain, place: FloatArray) -> FloatArray:
        """At places, (n_events, n)."""
        rows = zip(place, self.square, strict=True)
        return np.array([np.interp(one, terrain.edge_s_m, square) for one, square in rows])


def responses(terrain: Terrain, square: FloatArray, weakening_speed: float = 8.0) -> dict[Column, FloatArray]:
    """Retardation per unit of strength of each column, at U^2 in the middle of cells, (n_events, n_cells)."""
    square = np.maximum(square, 0.0)
    speed, normal = np.sqrt(square), GRAVITY * terrain.cos_slope
    return {
        Column.CONSTANT: np.ones_like(square),
        Column.LINEAR: speed,
        Column.QUADRATIC: square,
        Column.FRICTION: np.maximum(normal + terrain.curvature * square, 0.0),
        Column.WEAKENING: normal / (1.0 + speed / weakening_speed),
    }


def stops(problem: HierarchicalProblem) -> tuple[FloatArray, FloatArray]:
    """Where each front stopped [m] and how well that is known; NaN where it is not.

    Without a runout, half-way between the last sensor it reached and the first that it did not.
    """
    campaign, readings = problem.campaign, problem.readings
    between = np.isfinite(readings.reached) & np.isfinite(readings.not_reached)
    first, last = (np.where(between, one, np.nan) for one in (readings.reached, readings.not_reached))
    place, sd = 0.5 * (first + last), np.hypot(0.3 * (last - first), readings.place_sd)
    for j, sensor in enumerate(campaign.sensors):
        if sensor.is_runout:
            seen = problem.observed[:, j]
            own = campaign.reading_sd()[:, j]
            place, sd = np.where(seen, problem.values[:, j], place), np.where(seen, own, sd)
    return place, sd


def energy_balance(problem: HierarchicalProblem, ride: Ride | None, law: Law, theta: FloatArray) -> Balance:
    """Readings as U^2 at places, with errors of the predicted speed where there is one.

    Parameters
    ----------
    theta : (n_events, n_base) array
        Coefficients of the base law.
    """
    campaign, terrain = problem.campaign, problem.terrain
    speeds = [j for j, sensor in enumerate(campaign.sensors) if not sensor.is_runout]
    n, m = campaign.n_events, len(speeds)
    place, square, sd = np.zeros((n, m + 1)), np.zeros((n, m + 1)), np.ones((n, m + 1))
    known = np.zeros((n, m + 1), dtype=bool)
    for column, j in enumerate(speeds):
        sensor = campaign.sensors[j]
        middle = 0.5 * (sensor.s_from_m + sensor.s_to_m)
        seen = np.asarray(campaign.status[:, j] == Status.OBSERVED)
        read = np.where(seen, campaign.values[:, j], 0.0)
        place[:, column], known[:, column] = middle, seen
        expected = read
        if ride is not None:
            expected = np.sqrt(np.maximum(ride.at(terrain, place[:, [column]])[:, 0], _LEAST_SPEED_M_S**2))
            if sensor.is_span:
                mean = _span_mean(terrain, ride, sensor.s_from_m, sensor.s_to_m)
                read = read * np.clip(expected / mean, 0.7, 1.4)
        own = np.hypot(sensor.relative_sd * expected, sensor.absolute_sd)
        own = np.where(np.isfinite(campaign.stated_sd[:, j]), campaign.stated_sd[:, j], own)
        square[:, column] = np.where(seen, read**2 - own**2, 0.0)
        sd[:, column] = np.where(seen, np.sqrt(4.0 * expected**2 * own**2 + 2.0 * own**4) + 1e-3, 1.0)
    stop, stop_sd = stops(problem)
    known[:, m] = np.isfinite(stop)
    place[:, m] = np.where(known[:, m], stop, terrain.length_m)
    pull = np.abs(_net_at_rest(terrain, law, theta, place[:, m]))
    sd[:, m] = np.where(known[:, m], 2.0 * np.maximum(pull, _STEPPED) * np.nan_to_num(stop_sd, nan=1.0), 1.0)
    return Balance(place, known, square, sd)


def _span_mean(terrain: Terrain, ride: Ride, first: float, last: float) -> FloatArray:
    """Mean speed over a span: its length over the travel time."""
    at = np.tile(np.linspace(first, last, 15), (len(ride.square), 1))
    speed = np.sqrt(np.maximum(ride.at(terrain, at), _LEAST_SPEED_M_S**2))
    mean: FloatArray = 1.0 / np.mean(1.0 / speed, axis=1)
    return mean


def cell_of(terrain: Terrain, place: FloatArray) -> NDArray[np.int64]:
    """Which cell places are in."""
    found = np.searchsorted(terrain.edge_s_m, place, side="right") - 1
    return np.clip(found, 0, terrain.n_cells - 1)


def _net_at_rest(terrain: Terrain, law: Law, theta: FloatArray, place: FloatArray) -> FloatArray:
    """Acceleration of fronts that hardly move, at one place each, (n_events,)."""
    at_rest = responses(terrain, np.zeros((1, terrain.n_cells)))
    cell = cell_of(terrain, place)
    net = GRAVITY * terrain.sin_slope[cell]
    for k, mechanism in enumerate(law.mechanisms):
        column, profile = mechanism.term(terrain)
        net = net - theta[:, k] * (profile * at_rest[column][0])[cell]
    return np.asarray(net)


def forward(terrain: Terrain, law: Law, theta: FloatArray, release: FloatArray) -> Ride:
    """Integrate the base law with each event's coefficients, by Heun's method cell by cell."""
    terms = [mechanism.term(terrain) for mechanism in law.mechanisms]
    square = np.zeros((len(theta), terrain.n_cells + 1))
    first = cell_of(terrain, release)

    def slope(cell: int, v: FloatArray) -> FloatArray:
        net = np.full(len(theta), GRAVITY * terrain.sin_slope[cell])
        for k, (column, profile) in enumerate(terms):
            net -= theta[:, k] * profile[cell] * _response(terrain, column, cell, v)
        return 2.0 * net

    moving = np.ones(len(theta), dtype=bool)
    for cell in range(terrain.n_cells):
        length = terrain.edge_s_m[cell + 1] - np.maximum(terrain.edge_s_m[cell], release)
        v = square[:, cell]
        guess = np.maximum(v + length * slope(cell, v), 0.0)
        v = v + 0.5 * length * (slope(cell, v) + slope(cell, guess))
        inside = first <= cell
        moving &= ~inside | (v > 0.0)
        square[:, cell + 1] = np.where(inside & moving, np.minimum(v, 2e4), 0.0)
    return Ride(square)


def _response(terrain: Terrain, column: Column, cell: int, v: FloatArray) -> FloatArray | float:
    normal = GRAVITY * terrain.cos_slope[cell]
    if column is Column.CONSTANT:
        return 1.0
    if column is Column.QUADRATIC:
        return v
    if column is Column.LINEAR:
        return np.sqrt(v)
    if column is Column.FRICTION:
        return np.maximum(normal + terrain.curvature[cell] * v, 0.0)
    return normal / (1.0 + np.sqrt(v) / 8.0)


def smoothed(
    problem: HierarchicalProblem, balance: Balance, expected: Ride, length_m: float, share: float
) -> Ride:
    """Expected profiles bent to the readings by a normal process, 0 at the release and at the stop.

    Parameters
    ----------
    length_m : float
        Its correlation length.
    share : float
        Its standard deviation, as a share of the largest U^2 of the event.
    """
    terrain = problem.terrain
    edge, release = terrain.edge_s_m, problem.releases.mean
    at_readings = expected.at(terrain, balance.place)
    square = np.empty_like(expected.square)
    for i in range(len(square)):
        known = balance.known[i]
        at = np.append(balance.place[i, known], release[i])
        error = np.append(balance.sd[i, known], 1.0)
        away = np.append((balance.square[i] - at_readings[i])[known], 0.0)
        size = share * max(float(expected.square[i].max()), float(balance.square[i].max()), 25.0)
        cover = size**2 * np.exp(-0.5 * ((at[:, None] - at[None, :]) / length_m) ** 2)
        across = size**2 * np.exp(-0.5 * ((edge[:, None] - at[None, :]) / length_m) ** 2)
        bent = expected.square[i] + across @ np.linalg.solve(cover + np.diag(error**2), away)
        last = balance.place[i, -1] if known[-1] else np.inf
        square[i] = np.where((edge > release[i]) & (edge < last), np.maximum(bent, 0.0), 0.0)
    return Ride(square)


def starting_coefficients(problem: HierarchicalProblem, law: Law, *, own: bool = False) -> FloatArray:
    """Base coefficients to begin with: the best of a grid, (n_events, n_base).

    Parameters
    ----------
    own : bool
        Whether each event has its own; otherwise those that are best for all together.
    """
    terrain, n_events = problem.terrain, problem.campaign.n_events
    axes = [mechanism.strength.prior_scale * np.geomspace(0.04, 2.5, 16) for mechanism in law.mechanisms]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    of_event = np.tile(np.arange(n_events), len(grid))
    rides = forward(terrain, law, np.repeat(grid, n_events, axis=0), problem.releases.mean[of_event])
    balance = energy_balance(problem, None, law, np.tile(np.median(grid, axis=0), (n_events, 1)))
    away = balance.square[of_event] - rides.at(terrain, balance.place[of_event])
    # Events differ: a fifth of the square, and a part that counts where fronts are slow.
    allowed = np.hypot(balance.sd, 0.2 * balance.square + 20.0)[of_event]
    # U^2 is 0 at the stop also where the front came to rest far above: there the place counts.
    stop = np.max(np.where(rides.square > 0.0, terrain.edge_s_m, 0.0), axis=1)
    away[:, -1], allowed[:, -1] = balance.place[of_event, -1] - stop, _ALLOWED_STOP_M
    loss = np.log1p((away / allowed) ** 2) * balance.known[of_event]
    by_event = loss.sum(axis=1).reshape(len(grid), n_events)
    best = int(np.argmin(by_event.sum(axis=1)))
    if not own:
        return np.tile(grid[best], (n_events, 1))
    distance = np.sum(np.log(grid / grid[best]) ** 2, axis=1)
    return np.asarray(grid[np.argmin(by_event + distance[:, None], axis=0)])


def shares_passed(terrain: Terrain, release: FloatArray, place: FloatArray) -> FloatArray:
    """Metres of each cell between a release and places below it, (n_places, n_cells)."""
    edge = terrain.edge_s_m
    overlap = np.minimum(edge[None, 1:], place[:, None]) - np.maximum(edge[None, :-1], release)
    return np.asarray(np.clip(overlap, 0.0, np.diff(edge)[None, :]))
