"""Each reading as predicted by the readings of the same avalanche above it.

Most of the error of an avalanche that was left out is what avalanches differ in, and no added force changes
that. Given the readings further up, it is known, and what is left shows what a law says of the stretch in
between. Populations and coefficients are draws by the other avalanches alone.

An avalanche's own strengths and release are drawn around where the readings above put them, for each draw of
the population: the linear model at the conditional MAP gives a Student t. Some are drawn from the population
itself, so that weights stay bounded where the linear model is wrong. All draws serve all of an avalanche's
readings, weighed by the likelihood of those above: p(y | above) is a ratio of two such means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Rows
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.predictive import known_to_come
from skred.diagnosis.predict.draws import Draws, LeftOut
from skred.diagnosis.predict.event_proposal import Sample, sample
from skred.diagnosis.predict.held_out import HeldOut
from skred.inference.error_model import ErrorModel, EventReadings, fronts_seen
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import ENDS
from skred.inference.reading_density import log_likelihoods
from skred.parallel.threads import side_by_side

_POINTS = (4, 16, 16)
"""Points around each place for each draw of the population: at first, and twice more where too few of those
counted."""


@dataclass(frozen=True, eq=False)
class Conditional:
    """Each reading by those above it, under one law; all (n_events, n_sensors), NaN where nothing is read.

    Attributes
    ----------
    mean, low, high : arrays, m/s or m
        Of what would be read, errors included: mean, and 5 and 95 % quantiles. Of a speed above nil by fronts
        that come there.
    log_score : array
        Log predictive density of the reading.
    crps : array, m/s or m
        Continuous ranked probability score.
    n_above : integer array
        Readings of the same avalanche above it; 0 also where there is no reading.
    effective : array
        Effective number of draws.
    """

    mean: FloatArray
    low: FloatArray
    high: FloatArray
    log_score: FloatArray
    crps: FloatArray
    n_above: IntArray
    effective: FloatArray

    def covered(self, values: FloatArray) -> FloatArray:
        """1 where the central 90 % of the predictions hold the reading, else 0, NaN where there is none."""
        inside = (values >= self.low) & (values <= self.high)
        return np.where(np.isfinite(self.mean), inside, np.nan)


class BeforeAfter(NamedTuple):
    """By the base law, and by the law with what was added."""

    before: Conditional
    after: Conditional

    @classmethod
    def of(cls, before: HeldOut, after: HeldOut, seed: int) -> BeforeAfter:
        """Predict every reading twice, from what the other avalanches say and from those above it."""
        return cls(conditional(before.others, seed), conditional(after.others, seed))


def conditional(others: Sequence[LeftOut], seed: int) -> Conditional:
    """Predict each reading of each avalanche from those above it.

    Parameters
    ----------
    others : sequence of LeftOut
        What the other avalanches say of each.
    seed : int
        The same for two laws, so that they differ by themselves and not by random numbers.
    """
    parts = np.array(side_by_side(lambda event: _event(*others[event], event, seed), range(len(others))))
    mean, low, high, log_score, crps, n_above, effective = parts.transpose(1, 0, 2)
    n_above = np.nan_to_num(n_above).astype(np.int64)
    return Conditional(mean, low, high, log_score, crps, n_above, effective)


def sensor_ends(problem: HierarchicalProblem) -> FloatArray:
    """Upper and lower end of each sensor [m], (2, n_sensors); NaN of a runout."""
    places = [(np.nan, np.nan) if place is None else place for place in problem.sensor_places]
    return np.array(places, dtype=float).T


def above(problem: HierarchicalProblem) -> BoolArray:
    """Which sensors lie wholly above which, (n_sensors, n_sensors): row k has those above k.

    A front passes every sensor of speed before it stops: all of them are above the runout.
    """
    velocity = problem.readings.is_velocity
    first, last = sensor_ends(problem)
    passed = (last[None, :] <= first[:, None]) & (last[None, :] < last[:, None])
    return np.where(velocity[:, None], passed, velocity[None, :]) & velocity[None, :]


def _sets(problem: HierarchicalProblem, event: int) -> tuple[IntArray, BoolArray, IntArray, IntArray]:
    """What is predicted of one avalanche, and from what.

    Returns
    -------
    sensors : (n,) integer array
        Whose readings are predicted.
    sets : (n_sets, n_sensors) boolean array
        Sets of its readings, the empty one first.
    above, with_it : (n,) integer arrays
        Which set lies above each, and which holds it too.
    """
    observed = problem.readings.observed[event]
    sensors = np.flatnonzero(observed)
    before = above(problem)[sensors] & observed
    with_it = before.copy()
    with_it[np.arange(len(sensors)), sensors] = True
    nothing = np.zeros((1, len(observed)), dtype=bool)
    sets, place = np.unique(np.vstack([nothing, before, with_it]), axis=0, return_inverse=True)
    place = place.ravel()[1:]
    return sensors, sets, place[: len(sensors)], place[len(sensors) :]


def readings_of(problem: HierarchicalProblem, event: int, sets: BoolArray) -> EventReadings:
    """Some of an avalanche's readings, one row for each set.

    Bounds of a reading and places where it did not come are not among them: they may lie below.
    """
    readings = problem.readings
    come_to = fronts_seen(problem.campaign).come_to[event]
    return readings.take(np.full(len(sets), event))._replace(
        observed=sets,
        least=np.full(sets.shape, -np.inf),
        most=np.full(sets.shape, np.inf),
        reached=np.where(sets, come_to, -np.inf).max(axis=1, initial=-np.inf),
        not_reached=np.full(len(sets), np.inf),
    )


def _event(extension: Extension, draws: Draws, event: int, seed: int) -> FloatArray:
    """What `Conditional` has of one avalanche, (7, n_sensors)."""
    problem = extension.problem
    readings, errors = problem.readings, problem.error_model
    result = np.full((7, len(readings.is_velocity)), np.nan)
    sensors, sets, all_above, all_with_it = _sets(problem, event)
    if not len(sensors):
        return result
    rows = Rows(
        np.full(len(sets), event),
        np.zeros(len(sets), dtype=np.int64),
        readings_of(problem, event, sets),
        errors.errors,
    )
    rng = np.random.default_rng([seed, 61, event])
    likelihood = EventLikelihood(extension, rows, draws.strengths.mean(axis=0))
    first, *more = _POINTS
    found = sample(likelihood, draws, first, np.empty((0, extension.n_base + 1)), rng)
    for each in more:
        missed = found.missed()
        if len(missed):
            found = sample(likelihood, draws, each, missed, rng)
    fronts = found.fronts[:, :-1]
    drawn = errors.draw(fronts, readings.sd(event, fronts), readings.is_velocity, rng)
    outside = np.where(known_to_come(readings, event, fronts), 0.0, -np.inf)
    for sensor, before, with_it in zip(sensors, all_above, all_with_it, strict=True):
        log_weights = found.log_weights[before]
        together = _together(found, rows, before, sensor, drawn, errors)
        weights = _normalised(log_weights + together + outside[:, sensor])
        value, x = readings.values[event, sensor], drawn[:, sensor]
        effective = [1.0 / np.sum(w**2) for w in (weights, _normalised(found.log_weights[with_it]))]
        score = np.logaddexp.reduce(found.log_weights[with_it]) - np.logaddexp.reduce(log_weights)
        mean, low, high, crps = _summary(x, weights, value)
        result[:, sensor] = mean, low, high, score, crps, sets[before].sum(), min(effective)
    return result


def _normalised(log_weights: FloatArray) -> FloatArray:
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()


def _together(
    found: Sample, rows: Rows, before: int, sensor: int, drawn: FloatArray, errors: ErrorModel
) -> FloatArray | float:
    """By how much a reading's error is more probable beside those above, as a logarithm for each draw.

    Errors of an avalanche's readings have a factor or a part in common under some error models; drawn anew
    they have not. Where nothing is in common it is nothing.
    """
    common = errors.errors.common > 0.0 or np.ptp(errors.errors.scales) > 0.0
    if not common or not rows.readings.observed[before].any():
        return 0.0
    n = len(drawn)
    readings = rows.readings.take(np.full(n, before))
    values, alone = readings.values.copy(), np.zeros_like(readings.observed)
    values[:, sensor], alone[:, sensor] = drawn[:, sensor], True
    both, at = readings.observed | alone, np.arange(n)
    # Without where the front is known to have come: the same in both.
    readings = readings._replace(values=values, reached=np.full(n, -np.inf))
    joint, own = (
        log_likelihoods(at, found.fronts, readings._replace(observed=seen), rows.errors)
        for seen in (both, alone)
    )
    those = log_likelihoods(at, found.fronts, readings, rows.errors)
    ratio: FloatArray = joint - own - those
    return ratio


def _summary(x: FloatArray, weights: FloatArray, value: float) -> tuple[float, float, float, float]:
    """Mean, quantiles and continuous ranked probability score of weighed draws."""
    order = np.argsort(x)
    x, weights = x[order], weights[order]
    below = np.cumsum(weights)
    low, high = np.interp(ENDS, below - 0.5 * weights, x)
    apart = np.sum(weights * x * (2.0 * below - weights - 1.0))
    return float(weights @ x), float(low), float(high), float(weights @ np.abs(x - value) - apart)
