"""A base law with mechanisms added: what its fronts would be read as, with tangents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.campaign.parts import without_silent_sensors
from skred.diagnosis.evidence.covariates import standard_of
from skred.diagnosis.evidence.moved_sensors import StopBounds, stop_bounds
from skred.errors import InputError
from skred.inference.added_terms import contributions_with
from skred.inference.hierarchical.event_draws import FARTHEST
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.kernel.columns import Column
from skred.physics.kernel.fronts import front_speeds, simulate, simulate_with_jacobian
from skred.physics.kernel.inputs import Contributions, Path
from skred.physics.law import Law
from skred.physics.laws import check_library
from skred.physics.mechanisms.spec import Direction, Setting

_STEP_M = 0.01
"""Of the differences by a sensor's place [m]: above rounding, and hardly any front stops within it."""


def setting_of(problem: HierarchicalProblem, law: Law, front_speed: FloatArray | None = None) -> Setting:
    """What mechanisms added to a law on a campaign can refer to.

    Parameters
    ----------
    front_speed : (n_cells + 1,) array, optional
        Typical speed of the fitted fronts [m/s]; left at 0 nothing is looked for that refers to it.

    Raises
    ------
    InputError
        If a mechanism that may be added has a symbol of the law.
    """
    check_library(law)
    campaign = problem.campaign
    names = sorted({name for event in campaign.events for name in event.covariates})
    standards = {name: standard_of(campaign.events, name) for name in names}
    covariates = {
        name: standard.standardised(campaign.events, name)
        for name, standard in standards.items()
        if standard is not None
    }
    return Setting(
        terrain=problem.terrain,
        base=tuple(mechanism.id for mechanism in law.mechanisms),
        recorded_m=recorded_range(problem),
        sensors=tuple(campaign.sensor_ids),
        velocities=tuple(not sensor.is_runout for sensor in campaign.sensors),
        covariates=covariates,
        n_events=campaign.n_events,
        front_speed=np.zeros(problem.terrain.n_cells + 1) if front_speed is None else front_speed,
    )


def recorded_range(problem: HierarchicalProblem) -> tuple[float, float]:
    """Between which places of the track something was recorded [m]; a sensor that is silent tells of none."""
    speaking = without_silent_sensors(problem.campaign).sensors
    ends = [(sensor.s_from_m, sensor.s_to_m) for sensor in speaking if not sensor.is_runout]
    for j, sensor in enumerate(problem.campaign.sensors):
        if sensor.is_runout and problem.observed[:, j].any():
            stops = problem.values[problem.observed[:, j], j]
            ends.append((float(stops.min()), float(stops.max())))
    first, last = np.array(ends or [(0.0, problem.terrain.length_m)]).T
    return float(first.min()), max(float(last.max()), float(first.min()) + 1.0)


class Runs(NamedTuple):
    """Runs of the kernel, and what becomes of their readings.

    Attributes
    ----------
    strengths : (n, n_columns) array
        Of the base and of all columns that are added.
    releases, speeds : (n,) arrays, m and m/s
    factors : (n, n_sensors + 1) array
        What readings are multiplied by; a single row where none is off.
    shifts : (n, n_sensors + 1) array or None, m
        How much further down than noted each sensor stands; None where all stand there.
    """

    strengths: FloatArray
    releases: FloatArray
    speeds: FloatArray
    factors: FloatArray
    shifts: FloatArray | None

    def read(self, path: Path, law: Contributions, sensors: FloatArray) -> FloatArray:
        """Readings, (n, n_sensors + 1)."""
        readings = simulate(self.strengths, self.releases, path, law, sensors, self.speeds, self.shifts)
        return np.asarray(readings * self.factors)

    def moved(self, further: FloatArray) -> Runs:
        """The same with moved sensors that stand so many metres further down, (n_sensors + 1,)."""
        assert self.shifts is not None
        return self._replace(shifts=self.shifts + further)


@dataclass(frozen=True, eq=False)
class Extension:
    """A law with mechanisms added, on a campaign.

    Points below are the logarithms of an event's base strengths and, last, its release's deviation in
    standard deviations; rows are runs of the kernel, each of some event.

    Attributes
    ----------
    directions : tuple of Direction
        One for each added mechanism.
    """

    problem: HierarchicalProblem
    law: Law
    directions: tuple[Direction, ...] = ()

    @property
    def n_base(self) -> int:
        """Number of the base law's strengths."""
        return len(self.law.mechanisms)

    @cached_property
    def contributions(self) -> Contributions:
        """How the base's and the added strengths enter the equation of motion.

        Raises
        ------
        InputError
            If two of them weaken with different speed scales: the kernel has one.
        """
        base = self.problem.contributions(self.law.mechanisms)
        speeds = {d.weakening_speed for d in self.directions if d.weakening_speed is not None}
        if Column.WEAKENING in base.columns:
            speeds.add(base.weakening_speed)
        if len(speeds) > 1:
            raise InputError(
                f"friction that falls with speed has the scales {sorted(speeds)} m/s: a law can have one"
            )
        return contributions_with(base, self.directions)

    @cached_property
    def _owner(self) -> IntArray:
        """Which added mechanism each added column belongs to."""
        return np.repeat(np.arange(len(self.directions)), [len(d.columns) for d in self.directions])

    @cached_property
    def _stops(self) -> StopBounds:
        return stop_bounds(self.problem)

    def inputs(self, events: IntArray, points: FloatArray, strengths: FloatArray) -> Runs:
        """What the kernel is given for each row, and what becomes of its readings.

        Parameters
        ----------
        events : (n,) integer array
        points : (n, n_base + 1) array
        strengths : (n_directions,) or (n, n_directions) array
        """
        releases, n = self.problem.releases, self.n_base
        strengths = np.broadcast_to(strengths, (len(events), len(self.directions)))
        place = releases.mean[events] + releases.sd[events] * points[:, -1]
        rows = np.empty((len(events), n + len(self._owner)))
        rows[:, :n] = points[:, :n]
        rows[:, n:] = strengths[:, self._owner]
        log_factor, shifts = np.zeros((1, len(self.problem.sensors))), None
        for k, direction in enumerate(self.directions):
            if direction.release:
                place += strengths[:, k] * direction.release
            if direction.own is not None:
                rows[:, n:][:, self._owner == k] *= direction.own[events][:, None]
            if direction.log_strengths is not None:
                rows[:, 0] += strengths[:, k] * direction.log_strengths[events]
            if direction.log_readings is not None:
                reads = np.append(direction.log_readings, 0.0)
                log_factor = log_factor + np.outer(strengths[:, k], reads)
            if direction.places is not None:
                moved = np.outer(strengths[:, k], np.append(direction.places, 0.0))
                shifts = moved if shifts is None else shifts + moved
        # An event that nothing explains may be looked for beyond all numbers.
        rows[:, :n] = np.exp(np.minimum(rows[:, :n], FARTHEST))
        place = np.clip(place, releases.first, releases.length)
        return Runs(rows, place, releases.speeds(events, points[:, -1]), np.exp(log_factor), shifts)

    def predict(self, events: IntArray, points: FloatArray, strengths: FloatArray) -> FloatArray:
        """Readings of fronts, (n, n_sensors + 1), the runout last; spans up to the stop.

        The runout is what noted places are compared with: where a sensor is moved by which a front is known
        to have stopped below or above, see `StopBounds.as_noted`. All else is as for `inputs`.
        """
        return self._read(events, self.inputs(events, points, strengths))

    def _read(self, events: IntArray, runs: Runs) -> FloatArray:
        """Readings of runs, (n, n_sensors + 1), as `predict` has them."""
        readings = runs.read(self.problem.path, self.contributions, self.problem.sensors)
        if runs.shifts is not None:
            readings[:, -1], _ = self._stops.as_noted(readings[:, -1], events, runs.shifts[:, :-1])
        return readings

    def speeds(self, points: FloatArray, strengths: FloatArray) -> FloatArray:
        """Front speed of each event at the cells' edges [m/s], (n_events, n_cells + 1), at one point each."""
        runs = self.inputs(np.arange(len(points)), points, strengths)
        return front_speeds(runs.strengths, runs.releases, self.problem.path, self.contributions, runs.speeds)

    def tangents(
        self, events: IntArray, points: FloatArray, strengths: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `predict`, with the derivatives by the points and by the strengths added.

        Returns
        -------
        readings : (n, n_sensors + 1) array
        by_points : (n, n_sensors + 1, n_base + 1) array
        by_strengths : (n, n_sensors + 1, n_directions) array
        """
        runs = self.inputs(events, points, strengths)
        rows, releases, begin, factors, shifts = runs
        noted = self.problem.releases
        by_speed = bool(noted.speed_sd.any())
        path, sensors = self.problem.path, self.problem.sensors
        readings, jacobian = simulate_with_jacobian(
            rows, releases, path, self.contributions, sensors, begin, shifts, by_speed=by_speed
        )
        readings, jacobian = readings * factors, jacobian * factors[:, :, None]
        if shifts is not None:
            readings[:, -1], slope = self._stops.as_noted(readings[:, -1], events, shifts[:, :-1])
            jacobian[:, -1] *= slope[:, None]
        inside = (releases > noted.first) & (releases < noted.length)
        by_release = jacobian[:, :, rows.shape[1]] * inside[:, None]
        by_logs = jacobian[:, :, : self.n_base] * rows[:, None, : self.n_base]
        by_deviation = by_release * noted.sd[events][:, None]
        if by_speed:
            by_deviation += jacobian[:, :, -1] * noted.speed_sd[events][:, None]
        by_points = np.concatenate([by_logs, by_deviation[:, :, None]], axis=2)
        by_strengths = np.zeros((*readings.shape, len(self.directions)))
        added = jacobian[:, :, self.n_base : rows.shape[1]]
        for k, direction in enumerate(self.directions):
            of_columns = added[:, :, self._owner == k].sum(axis=2)
            if direction.own is not None:
                of_columns = of_columns * direction.own[events][:, None]
            by_strengths[:, :, k] = of_columns + by_release * direction.release
            if direction.log_strengths is not None:
                by_strengths[:, :, k] += by_logs[:, :, 0] * direction.log_strengths[events][:, None]
            if direction.log_readings is not None:
                by_strengths[:, :-1, k] += readings[:, :-1] * direction.log_readings
            if direction.places is not None:
                by_strengths[:, :, k] += self._by_places(events, runs, direction.places)
        return readings, by_points, by_strengths

    def _by_places(self, events: IntArray, runs: Runs, places: FloatArray) -> FloatArray:
        """Change of the readings as sensors are moved, by so much each per unit, (n, n_sensors + 1)."""
        step = _STEP_M * np.append(places, 0.0)
        ahead, behind = (self._read(events, runs.moved(by)) for by in (step, -step))
        return (ahead - behind) / (2.0 * _STEP_M)


def typical_speed(speeds: FloatArray) -> FloatArray:
    """Root of the mean square over the fronts that come by, 0 where none does, (n_edges,)."""
    fronts = np.maximum((speeds > 0.0).sum(axis=0), 1)
    return np.sqrt((speeds**2).sum(axis=0) / fronts)


def extended(problem: HierarchicalProblem, law: Law, directions: Sequence[Direction] = ()) -> Extension:
    """A law with mechanisms added."""
    return Extension(problem, law, tuple(directions))
