"""Where along a coefficient the evidence may have a maximum: climbs from several starts, everything refitted.

Around the events' modes readings are linear in the population's median, in the events' own strengths and in
the coefficient, all at once. A step therefore moves all of them together. A drag that the base law's friction
has absorbed comes in while friction falls to a third; neither a derivative at nil nor a refit at a fixed
coefficient gets there. Each event's point follows the step in the linear model, so that fronts stay with
their readings. This is Gauss and Newton's method for a nonlinear mixed model (Lindstrom and Bates, 1990, doi
10.2307/2532087), with spreads by expectation-maximisation. It begins at nil and at the mechanism's scale.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    Rows,
    deviations,
    event_modes,
    log_joint,
    look_around,
)
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import (
    MeanPrior,
    joint_step,
    mean_prior,
    most_probable_covariance,
)
from skred.diagnosis.evidence.refit import Fit, unfitted
from skred.diagnosis.evidence.tolerance import ARRIVED, STEP_SHARES
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN
from skred.physics.mechanisms.strength_prior import SCALES

STARTS = (0.0, 0.3, 1.2)
"""Where climbs begin, in scales of the mechanism: nil, and either side of its median (0.57)."""
_ROUNDS = 15
"""Steps at most. Where fronts stop a climb could go to and fro."""
_CLIMB = 4
"""Steps of the events' modes after each step of the others."""


class Start(NamedTuple):
    """A maximum along the coefficient, in the linear model around the events' modes.

    Attributes
    ----------
    strength, sd : float
        In the coefficient's unit.
    fit : Fit
        Population and events there; its evidence is not known.
    """

    strength: float
    sd: float
    fit: Fit


class _State(NamedTuple):
    """Where climbs are, one group each."""

    strengths: FloatArray
    population: Population
    modes: Modes
    height: FloatArray

    def rows_of(self, groups: IntArray) -> IntArray:
        """Numbers of the groups' rows."""
        n = len(self.modes.points) // len(self.strengths)
        return (n * groups[:, None] + np.arange(n)).ravel()

    def take(self, groups: IntArray) -> _State:
        """Some of the groups."""
        rows = self.rows_of(groups)
        return _State(
            self.strengths[groups],
            self.population.take(groups),
            Modes(*(part[rows] for part in self.modes)),
            self.height[groups],
        )

    def put(self, groups: IntArray, there: _State) -> None:
        """Some of the groups at where they are now."""
        self.strengths[groups], self.height[groups] = there.strengths, there.height
        for whole, part in zip(self.population, there.population, strict=True):
            whole[groups] = part
        self.modes.put(self.rows_of(groups), there.modes)


class _Climb:
    """Climbs along the last of an extension's directions, side by side."""

    def __init__(
        self, extension: Extension, rows: Rows, held: FloatArray, scale: float, either_sign: bool
    ) -> None:
        self.extension, self.rows, self.held = extension, rows, held
        self.either_sign, self.precision = either_sign, (SCALES[-1] * scale) ** -2.0
        self.prior: MeanPrior = mean_prior(extension.law)

    def at(self, strengths: FloatArray, population: Population, points: FloatArray, n_steps: int) -> _State:
        """The events' modes, from points nearby, and the height there."""
        given = np.column_stack([np.tile(self.held, (len(strengths), 1)), strengths])
        likelihood = EventLikelihood(self.extension, self.rows, np.empty(0)).in_groups(given)
        points = event_modes(likelihood, points, population, n_steps).points
        modes = look_around(likelihood, points)
        return _State(strengths, population, modes, self._height(likelihood, modes, population, strengths))

    def _height(
        self, likelihood: EventLikelihood, modes: Modes, population: Population, strengths: FloatArray
    ) -> FloatArray:
        """Log posterior density, each event's integral by the Laplace approximation."""
        precision = population.precision[likelihood.rows.group]
        integrals = log_joint(likelihood, modes.points, population, modes.predictions)
        with np.errstate(invalid="ignore"):  # a climb that has left what numbers can hold is not taken
            integrals -= 0.5 * np.linalg.slogdet(modes.information + precision)[1]
            integrals += 0.5 * np.linalg.slogdet(precision)[1]
        spreads = 0.5 * np.log(np.einsum("gii->gi", population.covariance))
        height = integrals.reshape(len(strengths), -1).sum(axis=1)
        height -= 0.5 * (((spreads - math.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD) ** 2).sum(axis=1)
        height -= 0.5 * (((population.mean - self.prior.mean) / self.prior.sd) ** 2).sum(axis=1)
        return np.nan_to_num(height - 0.5 * self.precision * strengths**2, nan=-np.inf)

    def moved(self, state: _State) -> _State:
        """One step of each climb, or a part of it, as far as it gains."""
        n_groups = len(state.strengths)
        rows = self.rows.repeated(n_groups)
        population = self._with_spreads(state, rows)
        step = joint_step(state.modes, rows, population, self.prior, state.strengths, self.precision)
        if not self.either_sign:
            step = step.held(np.flatnonzero(state.strengths + step.strength < 0.0), -state.strengths)
        after, open_ = state.take(np.arange(n_groups)), np.arange(n_groups)
        for share in STEP_SHARES:
            points = state.modes.points + step.of_points(share, rows)
            there = self.at(
                (state.strengths + share * step.strength)[open_],
                Population((state.population.mean + share * step.mean)[open_], population.covariance[open_]),
                points[state.rows_of(open_)],
                _CLIMB,
            )
            gained = there.height >= state.height[open_] - 1e-9
            after.put(open_[gained], there.take(np.flatnonzero(gained)))
            open_ = open_[~gained]
            if not len(open_):
                break
        return after

    def _with_spreads(self, state: _State, rows: Rows) -> Population:
        """The populations with the covariances that the events ask for."""
        mean, n = state.population.mean, state.population.mean.shape[1]
        cover = np.linalg.inv(state.modes.information + state.population.precision[rows.group])
        deviation = deviations(state.modes.points, rows, state.population)
        return Population(mean, most_probable_covariance(rows, deviation[:, :n], cover[:, :n, :n]))


def first_strengths(scale: float, either_sign: bool) -> FloatArray:
    """Strengths at which climbs begin, nil among them, in the coefficient's unit."""
    signs = np.array([-1.0, 1.0] if either_sign else [1.0])
    return np.unique(np.multiply.outer(signs, scale * np.array(STARTS)))


def global_starts(
    extension: Extension,
    rows: Rows,
    held: FloatArray,
    begin: tuple[Population, FloatArray],
    scale: float,
    either_sign: bool,
) -> list[Start]:
    """Maxima along the coefficient of an extension's last direction, the highest first.

    Parameters
    ----------
    rows : Rows
        The campaign's rows.
    held : (n_directions - 1,) array
        Strengths of the directions before.
    begin : (Population, (n_events, n_base + 1) array)
        The fit without the last direction.
    scale : float
        The mechanism's own, in the coefficient's unit.
    either_sign : bool
        Whether the coefficient may be negative.
    """
    starts = first_strengths(scale, either_sign)
    n_groups, n_events = len(starts), len(rows.event)
    climb = _Climb(extension, rows, held, scale, either_sign)
    population = Population(*(np.repeat(part, n_groups, axis=0) for part in begin[0]))
    state = climb.at(starts, population, np.tile(begin[1], (n_groups, 1)), _CLIMB)
    climbing = np.arange(n_groups)
    for _ in range(_ROUNDS):
        before = state.take(climbing)
        after = climb.moved(before)
        state.put(climbing, after)
        climbing = climbing[after.height > before.height + ARRIVED]
        if not len(climbing):
            break
    all_rows = rows.repeated(n_groups)
    sd = joint_step(state.modes, all_rows, state.population, climb.prior, state.strengths, climb.precision).sd
    found: list[Start] = []
    for k in np.argsort(-state.height):
        population = state.population.take(slice(k, k + 1))
        points = state.modes.points[k * n_events : (k + 1) * n_events]
        one = Start(float(state.strengths[k]), float(sd[k]), Fit(unfitted(population), points))
        # Less than a standard deviation apart two climbs have come to the same maximum.
        if all(abs(one.strength - other.strength) > other.sd for other in found):
            found.append(one)
    return found
