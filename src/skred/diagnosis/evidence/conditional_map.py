"""The conditional MAP: the most probable strengths and release of each event, given its population."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.score_information import reading_slopes
from skred.diagnosis.evidence.tolerance import ARRIVED, DECIDES_NOTHING
from skred.inference.error_model import Errors, EventReadings
from skred.inference.reading_density import log_likelihoods

_STARTING_DAMPING = 1e-3
"""Of the Levenberg-Marquardt steps, relative to the diagonal: nearly none."""
_LOST = 20.0
"""Nats less than at best that the readings of a lost row have."""
_ASIDE = np.multiply.outer((-1.0, 1.0), (0.01, 0.03, 0.08, 0.2, 0.5, 1.0)).ravel()
"""Where to look for lost rows: changes of the logarithm of the first strength, from what moves a stop by ten
metres to what the largest step of a climb is."""
_STEEPEST = 1e4
"""Largest change of a reading, in standard deviations, per unit of an event's log strength."""


class Rows(NamedTuple):
    """Recordings to be explained: those of a campaign, or of many replicates of it one after the other.

    Attributes
    ----------
    event : (n_rows,) integer array
        Whose release and covariates each row has.
    group : (n_rows,) integer array
        Which replicate it belongs to.
    readings : EventReadings
        With one row each.
    """

    event: IntArray
    group: IntArray
    readings: EventReadings
    errors: Errors

    def take(self, chosen: IntArray) -> Rows:
        """Some of the rows, of the same groups."""
        return Rows(self.event[chosen], self.group[chosen], self.readings.take(chosen), self.errors)

    def of_groups(self, numbers: IntArray) -> tuple[IntArray, Rows]:
        """Which rows are of some groups, (n,) increasing numbers; and these, the groups numbered anew."""
        own = np.flatnonzero(np.isin(self.group, numbers))
        some = self.take(own)
        return own, some._replace(group=np.searchsorted(numbers, some.group))

    def repeated(self, n_groups: int) -> Rows:
        """The same rows, of one group, for each of several."""
        n = len(self.event)
        readings = self.readings.take(np.tile(np.arange(n), n_groups))
        return Rows(np.tile(self.event, n_groups), np.repeat(np.arange(n_groups), n), readings, self.errors)

    @property
    def n_groups(self) -> int:
        """Number of replicates."""
        return int(self.group[-1]) + 1


class Population(NamedTuple):
    """Normal population of the logarithms of the strengths, one for each group.

    Attributes
    ----------
    mean : (n_groups, n_base) array
    covariance : (n_groups, n_base, n_base) array
    """

    mean: FloatArray
    covariance: FloatArray

    @property
    def precision(self) -> FloatArray:
        """Inverse covariances, the release's unit precision last, (n_groups, n_base + 1, n_base + 1)."""
        n = self.mean.shape[1]
        result = np.zeros((len(self.mean), n + 1, n + 1))
        result[:, :n, :n] = np.linalg.inv(self.covariance)
        result[:, n, n] = 1.0
        return result

    @property
    def groups(self) -> list[Population]:
        """Each group by itself."""
        return [self.take(slice(k, k + 1)) for k in range(len(self.mean))]

    def take(self, groups: IntArray | slice) -> Population:
        """Some of the groups."""
        return Population(self.mean[groups], self.covariance[groups])

    def with_more(self, more: Population) -> Population:
        """These groups and others."""
        return Population(*(np.concatenate([a, b]) for a, b in zip(self, more, strict=True)))


class Modes(NamedTuple):
    """Most probable points and what the readings say around them.

    Attributes
    ----------
    points : (n_rows, n_base + 1) array
    tangents_at : (n_rows, n_base + 1) array
        Where what follows was computed: at the points, or a last, small step before them.
    predictions : (n_rows, n_columns) array
    by_points : (n_rows, n_columns, n_base + 1) array
    by_strengths : (n_rows, n_columns, n_directions) array
    slope, curvature : (n_rows, n_columns) arrays
        Of the log likelihood by the predictions.
    shared : (n_rows, n_columns) array
        What an error common to a row's velocities takes from the curvature: its product with itself.
    """

    points: FloatArray
    tangents_at: FloatArray
    predictions: FloatArray
    by_points: FloatArray
    by_strengths: FloatArray
    slope: FloatArray
    curvature: FloatArray
    shared: FloatArray

    def put(self, rows: IntArray, there: Modes) -> None:
        """Some of the rows at where they are now."""
        for whole, part in zip(self, there, strict=True):
            whole[rows] = part

    @property
    def information(self) -> FloatArray:
        """Of the readings about the points, (n_rows, n_base + 1, n_base + 1)."""
        return self.by_points.transpose(0, 2, 1) @ self.weighed(self.by_points)

    def weighed(self, changes: FloatArray) -> FloatArray:
        """Changes of the predictions, (n_rows, n_columns, n), times the readings' information."""
        weighed: FloatArray = self.curvature[:, :, None] * changes
        if self.shared.any():
            weighed -= self.shared[:, :, None] * (self.shared[:, None, :] @ changes)
        return weighed


@dataclass(frozen=True)
class EventLikelihood:
    """How likely rows of readings are, as functions of each row's own point.

    Attributes
    ----------
    extension : Extension
        A law with mechanisms added.
    strengths : (n_directions,) or (n_rows, n_directions) array
        Of what is added.
    """

    extension: Extension
    rows: Rows
    strengths: FloatArray

    @property
    def given(self) -> FloatArray:
        """Strengths of each row, (n_rows, n_directions)."""
        shape = len(self.rows.event), len(self.extension.directions)
        return np.broadcast_to(self.strengths, shape)

    def take(self, chosen: IntArray) -> EventLikelihood:
        """Some of the rows, perhaps repeated."""
        return EventLikelihood(self.extension, self.rows.take(chosen), self.given[chosen])

    def part(self, rows: slice) -> EventLikelihood:
        """Rows that follow each other."""
        return self.take(np.arange(len(self.rows.event))[rows])

    def in_groups(self, strengths: FloatArray) -> EventLikelihood:
        """The rows, of one group, at each of several strengths, (n_groups, n_directions)."""
        given = np.repeat(strengths, len(self.rows.event), axis=0)
        return EventLikelihood(self.extension, self.rows.repeated(len(strengths)), given)

    def of_groups(self, numbers: IntArray) -> EventLikelihood:
        """The rows of some of the groups, (n,) increasing numbers, which are numbered anew."""
        own, rows = self.rows.of_groups(numbers)
        return EventLikelihood(self.extension, rows, self.given[own])

    def at(self, points: FloatArray) -> FloatArray:
        """Log likelihood of each row at its point, (n_rows, n_base + 1) to (n_rows,)."""
        return self.of(self.predict(points))

    def predict(self, points: FloatArray) -> FloatArray:
        """What each row's front does at its point, (n_rows, n_base + 1) to (n_rows, n_columns)."""
        return self.extension.predict(self.rows.event, points, self.strengths)

    def of(self, predictions: FloatArray) -> FloatArray:
        """Log likelihood of each row given what its front does, (n_rows, n_columns) to (n_rows,)."""
        return log_likelihoods(np.arange(len(predictions)), predictions, self.rows.readings, self.rows.errors)


def look_around(likelihood: EventLikelihood, points: FloatArray) -> Modes:
    """Tangents, and score and information of the readings, at each row's point."""
    extension, rows = likelihood.extension, likelihood.rows
    predictions, by_points, by_strengths = extension.tangents(rows.event, points, likelihood.strengths)
    at = np.arange(len(points))
    slope, curvature, shared = reading_slopes(at, predictions, rows.readings, rows.errors)
    # Where friction falls with speed a front can be at the very edge of stopping: a slope without end.
    steepest = np.sqrt(curvature) * np.abs(by_points).max(axis=2)
    limited = 1.0 / np.maximum(steepest / _STEEPEST, 1.0)
    by_points, by_strengths = by_points * limited[:, :, None], by_strengths * limited[:, :, None]
    return Modes(points, points, predictions, by_points, by_strengths, slope, curvature, shared)


def deviations(points: FloatArray, rows: Rows, population: Population) -> FloatArray:
    """Deviation of points from their population's mean, the release's last."""
    deviation = points.copy()
    deviation[:, :-1] -= population.mean[rows.group]
    return deviation


def log_joint(
    likelihood: EventLikelihood,
    points: FloatArray,
    population: Population,
    predictions: FloatArray | None = None,
) -> FloatArray:
    """Log likelihood of each row plus the exponent of its population's density, (n_rows,).

    Parameters
    ----------
    predictions : (n_rows, n_columns) array, optional
        What the fronts do there, where that is known.
    """
    log_l = likelihood.at(points) if predictions is None else likelihood.of(predictions)
    deviation = deviations(points, likelihood.rows, population)
    return log_l - _half_square(deviation, population.precision[likelihood.rows.group])


def _half_square(deviation: FloatArray, precision: FloatArray) -> FloatArray:
    """Minus the exponent of a normal density, (n_rows, n) and (n_rows, n, n) to (n_rows,)."""
    return 0.5 * np.einsum("ri,rij,rj->r", deviation, precision, deviation)


def event_modes(
    likelihood: EventLikelihood, start: FloatArray, population: Population, n_steps: int = 12
) -> Modes:
    """Most probable points by damped Gauss-Newton steps; a step that makes a row worse is not taken.

    Rows that are far from their readings then, as where a front stops before a sensor that the recorded one
    passed and no slope leads it on, climb once more from the best of some places along the first strength,
    where one is better.

    Parameters
    ----------
    start : (n_rows, n_base + 1) array
    """
    found = _climbed(likelihood, start, population, n_steps)
    lost = lost_rows(likelihood.rows, found.predictions)
    if len(lost):
        points, gained = _aside(likelihood.take(lost), found.points[lost], population)
        moved = lost[gained]
        found.put(moved, _climbed(likelihood.take(moved), points[gained], population, n_steps))
    return found


def _climbed(likelihood: EventLikelihood, start: FloatArray, population: Population, n_steps: int) -> Modes:
    """Where damped Gauss-Newton steps from one place lead."""
    points, precision = start.copy(), population.precision[likelihood.rows.group]
    best = np.empty(len(points))
    damping = np.full(len(points), _STARTING_DAMPING)
    active = np.arange(len(points))
    found: Modes | None = None
    for _ in range(n_steps):
        part = likelihood if len(active) == len(points) else likelihood.take(active)
        around = look_around(part, points[active])
        deviation, prior = deviations(points[active], part.rows, population), precision[active]
        if found is None:
            best[:] = part.of(around.predictions) - _half_square(deviation, prior)
        gradient = np.einsum("ri,rij->rj", around.slope, around.by_points)
        gradient -= np.einsum("rij,rj->ri", prior, deviation)
        damped = around.information + prior
        diagonal = np.einsum("rii->ri", damped)
        diagonal *= 1.0 + damping[active][:, None]
        step = np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
        # By a factor e at most: tangents say nothing of a front three times as strong.
        step *= (1.0 / np.maximum(np.abs(step).max(axis=1), 1.0))[:, None]
        ahead = points[active] + step
        new = part.at(ahead) - _half_square(deviations(ahead, part.rows, population), prior)
        gained = new - best[active]
        better = gained >= -1e-9
        points[active[better]] = ahead[better]
        best[active[better]] = new[better]
        damping[active] = np.where(better, 0.2 * damping[active], np.maximum(20.0 * damping[active], 0.1))
        if found is None:
            found = Modes(*(values.copy() for values in around))
        else:
            found.put(active, around)
        active = active[~better | (gained > ARRIVED)]
        if len(active) == 0:
            break
    assert found is not None
    # Tangents are those before each row's last, small step; the points are after it.
    return found._replace(points=points)


def lost_rows(rows: Rows, predictions: FloatArray) -> IntArray:
    """Rows whose readings would be much likelier if they, and the range of the stop, were as predicted."""
    readings, at = rows.readings, np.arange(len(predictions))
    met = predictions.copy()
    inside = np.clip(predictions[:, :-1], readings.least, readings.most)
    met[:, :-1] = np.where(readings.observed, readings.values, inside)
    met[:, -1] = np.clip(predictions[:, -1], readings.reached, readings.not_reached)
    heights = [log_likelihoods(at, one, readings, rows.errors) for one in (predictions, met)]
    # Half a nat a reading is what noise alone takes.
    return np.flatnonzero(heights[1] > heights[0] + _LOST + 0.5 * readings.observed.sum(axis=1))


def _aside(
    likelihood: EventLikelihood, points: FloatArray, population: Population
) -> tuple[FloatArray, BoolArray]:
    """The best of each row's point and some places on either side of it, and whether it is one of those."""
    n_rows, n_places = len(points), len(_ASIDE)
    around = np.repeat(points, n_places, axis=0)
    around[:, 0] += np.tile(_ASIDE, n_rows)
    which = np.repeat(np.arange(n_rows), n_places)
    heights = log_joint(likelihood.take(which), around, population).reshape(n_rows, n_places)
    before = log_joint(likelihood, points, population)
    gained = heights.max(axis=1) > before + DECIDES_NOTHING
    best = around.reshape(n_rows, n_places, -1)[np.arange(n_rows), heights.argmax(axis=1)]
    return np.where(gained[:, None], best, points), gained


def campaign_rows(extension: Extension) -> Rows:
    """The recordings of the campaign itself."""
    problem = extension.problem
    n = problem.campaign.n_events
    return Rows(np.arange(n), np.zeros(n, dtype=np.int64), problem.readings, problem.error_model.errors)
