"""How far an answer hangs on few recordings: its evidence again without each avalanche, each kind of reading.

Of a single avalanche no refit is needed: evidence is what all others have, times the density of this one
given them. So the Bayes factor without it is that of all, less what it is predicted better with the answer
(nearly, where many are left out in parts). Without several, or without a kind of reading, population and
every avalanche are refitted to what is left, at all strengths of the named mechanism's leading shapes, or
with the whole profile. Nothing is chosen again: the question is whether what was answered would still stand.
Of a speed that is left out it stays known that the front came there.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.diagnosis.compare.between import or_none, searched
from skred.diagnosis.compare.candidate import Candidate, all_but_place, log_gain
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.ways import gains_of
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Profile, log_evidence_of, most_probable
from skred.diagnosis.evidence.coefficient import Base, curve_at
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING
from skred.diagnosis.predict.conditional import sensor_ends
from skred.parallel.processes import worker_pool

MOST = 1.0 / 3.0
"""Share of the avalanches that an answer may hang on and be said to be carried by few: more is not few."""


@dataclass(frozen=True)
class ReadingsLeftOut:
    """The evidence without some of the readings.

    Attributes
    ----------
    kind : str
        ``zeros``, ``near a stop``, or ``sensor``.
    sensor : str or None
        Which one, where it is a sensor's.
    n : int
        How many readings were left out.
    log_bayes_factor : float
    """

    kind: str
    sensor: str | None
    n: int
    log_bayes_factor: float


@dataclass(frozen=True, eq=False)
class Influence:
    """What the leading answer hangs on.

    Attributes
    ----------
    answer : str
        Id of a mechanism, or ``unlisted``.
    log_bayes_factor : float
        Against nothing, by all recordings.
    needed : float
        Log Bayes factor that it needs for an alarm, if whatever else may be missing falls with it.
    events : tuple of str
    without_each : (n_events,) array
        Log Bayes factor without each avalanche.
    carried_by : tuple of str
        The fewest avalanches, at most a third of them, without which it has less than it needs; empty where
        there are none. They are looked for in the order of what each one takes by itself.
    without_them : float or None
        Log Bayes factor without those.
    without_a_third : float
        Without the third of the avalanches that take most of it.
    readings : tuple of ReadingsLeftOut
    """

    answer: str
    log_bayes_factor: float
    needed: float
    events: tuple[str, ...]
    without_each: FloatArray
    carried_by: tuple[str, ...]
    without_them: float | None
    without_a_third: float
    readings: tuple[ReadingsLeftOut, ...]


def influence(comparison: Comparison, answer: str, gained: FloatArray, enough: float) -> Influence:
    """What an answer of a comparison hangs on, under the error model that it has most evidence under.

    Parameters
    ----------
    answer : str
        Id of a mechanism that was compared, or ``unlisted``.
    gained : (n_events,) array
        Log predictive density of each avalanche given the others with the answer, less that without it.
    enough : float
        Log odds of anything against nothing that raise an alarm.
    """
    under_errors = comparison.leading(answer)
    base = under_errors.base
    if answer == UNLISTED:
        again = partial(_by_profile, most_probable(under_errors.profiles), base)
        stated = log_evidence_of(under_errors.profiles)
    else:
        candidate = under_errors.candidates[answer]
        again = partial(_by_mechanism, candidate, base)
        stated = candidate.alone + log_gain(None, candidate.gains)
    n = len(base.rows.event)
    everything = np.ones(n, dtype=bool)
    kinds = _kinds(base)
    parts = [_Part(everything, chosen) for _, _, chosen in kinds]
    without_each = stated - gained
    # What is tied with the answer explains the same recordings: without some of them it falls as much.
    needed = max(stated - (comparison.log_odds - enough), 0.0)
    order, third = np.argsort(without_each), int(MOST * n)
    parts = [_Part(everything), _first_left_out(order, third), *parts]
    # By the same, quicker method on both sides; only the difference is taken from it.
    with worker_pool() as pool:
        whole, *found = pool.map(again, parts)
    without_third, *without_kinds = stated + np.array(found) - whole
    left_by = cache(lambda many: stated + again(_first_left_out(order, many)) - whole)
    many, left = 0, without_third
    if left < needed:
        # Each one more leaves less: their number is found by halving.
        many = 1 + bisect_left(range(1, third), True, key=lambda so_many: left_by(so_many) < needed)
        left = without_third if many == third else left_by(many)
    ids = base.problem.campaign.event_ids
    return Influence(
        answer,
        stated,
        needed,
        tuple(ids),
        without_each,
        tuple(ids[k] for k in sorted(order[:many])),
        float(left) if many else None,
        float(without_third),
        tuple(
            ReadingsLeftOut(kind, sensor, int(chosen.sum()), float(factor))
            for (kind, sensor, chosen), factor in zip(kinds, without_kinds, strict=True)
        ),
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of the recordings.

    Attributes
    ----------
    kept : (n_events,) boolean array
        Avalanches that are kept.
    left_out : (n_events, n_sensors) boolean array, optional
        Readings that are not.
    """

    kept: BoolArray
    left_out: BoolArray | None = None

    def fit(self, fit: Fit) -> Fit:
        """Where to begin with the avalanches that are kept."""
        return fit._replace(points=fit.points[self.kept])

    def base(self, base: Base) -> Base:
        """The base law on what is kept."""
        rows, readings = base.rows, base.rows.readings
        if self.left_out is not None:
            left = readings._replace(
                observed=readings.observed & ~self.left_out,
                least=np.where(self.left_out, -np.inf, readings.least),
                most=np.where(self.left_out, np.inf, readings.most),
            )
            rows = rows._replace(readings=left)
        return replace(base, rows=rows.take(np.flatnonzero(self.kept)), fit=self.fit(base.fit))


def _by_mechanism(candidate: Candidate, base: Base, part: _Part) -> float:
    """The log Bayes factor of a mechanism by a part of the recordings, over its leading shapes."""
    factors, best = candidate.log_factors, candidate.best
    rest, of_kind, others = part.base(base), list[float](), list[float]()
    for k, curve in enumerate(candidate.curves):
        if factors[k] <= factors.max() - DECIDES_NOTHING and curve is not best:
            continue
        known = {strength: part.fit(fit) for strength, fit in curve.known.items()}
        one = curve_at(rest, curve, curve.strengths, USUAL, known)
        own = of_kind if all_but_place(curve) == all_but_place(best) else others
        own.append(candidate.log_weights[k] + one.log_bayes_factor)
        if curve is best:
            at_best = one
    gain = 0.0
    if candidate.looked:
        ways = or_none(searched, rest, at_best)
        gain = 0.0 if ways is None else log_gain(None, gains_of(ways, at_best.log_factor_of(at_best.sign)))
    # What another kind of shape gains where avalanches differ is not known for a part, and not counted.
    return float(np.logaddexp.reduce([*others, gain + np.logaddexp.reduce(of_kind)]))


def _by_profile(profile: Profile, base: Base, part: _Part) -> float:
    """The log Bayes factor of a profile by a part of the recordings."""
    near = profile.mean, part.fit(profile.fit).start
    return fit_profile(part.base(base), profile.kind, near, profile.prior).log_bayes_factor


def _first_left_out(order: IntArray, many: int) -> _Part:
    """The recordings without the first avalanches of an order."""
    return _Part(~np.isin(np.arange(len(order)), order[:many]))


def _kinds(base: Base) -> list[tuple[str, str | None, BoolArray]]:
    """Readings that may mean something else than they say, and each sensor's, as (n_events, n_sensors)."""
    readings, campaign = base.rows.readings, base.problem.campaign
    observed = readings.observed
    speeds = observed & readings.is_velocity
    first, last = sensor_ends(base.problem)
    # Stops that are recorded, one column for each sensor of the runout, with their standard deviations.
    stops = np.where(observed & ~readings.is_velocity, readings.values, np.nan)
    off = np.abs(0.5 * (first + last)[:, None] - stops[:, None])
    near = speeds & (off <= readings.sd(np.arange(len(stops)), readings.values)[:, None]).any(axis=2)
    kinds: list[tuple[str, str | None, BoolArray]] = [
        ("zeros", None, speeds & (readings.values == 0.0)),
        ("near a stop", None, near),
    ]
    for j, sensor in enumerate(campaign.sensor_ids):
        own = np.zeros_like(observed)
        own[:, j] = observed[:, j] | readings.bounded[:, j]
        kinds.append(("sensor", sensor, own))
    return [one for one in kinds if one[2].any()]
