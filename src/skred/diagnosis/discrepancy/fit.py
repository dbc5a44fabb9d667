"""The unlisted force fitted: climbed to under one prior after the other, and its evidence over all of them.

Gauss-Newton steps around the events' modes; the evidence with nodes at each top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from skred.diagnosis.discrepancy.profile import (
    NEAR_M,
    Hill,
    Kind,
    Prior,
    Profile,
    combined,
    hats,
    knot_by_knot,
    knots,
    priors_of,
)
from skred.diagnosis.evidence.coefficient import Base, Curve, Fit, Rounds, refit
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, look_around
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, mean_prior

FloatArray = NDArray[np.float64]
Start = tuple[FloatArray, tuple[Population, FloatArray]]
_PRIORS_TRIED = 12
"""Priors climbed under at most, which bounds the time; climbs end before where those left hold little."""
_PRIORS_AGAIN = 4
"""The same where a fit to all avalanches is at hand: those close to its prior, and those that lead then."""
_ROUNDS = 6
"""Gauss-Newton steps at most: at kinks where fronts stop a climb could go to and fro."""
_SURE = 1.0
"""Nats that decide nothing: priors not climbed under that could add less together are left."""
_NO_FORCE = -0.5
"""Log Bayes factor below which the force is less probable than none under every prior, and climbs end."""
_SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried one after the other: a full step can stop fronts that went on."""
_SETTLED = 0.05
"""Nats gained by a step below which a climb has arrived."""
_MODES_WITHIN = 4.0
"""Nats behind the most probable prior from which on none is worth to be sampled under."""


@dataclass(frozen=True, eq=False)
class _Peak:
    """A profile's values, the fit with it in, and the likelihood's slope and curvature there."""

    values: FloatArray
    fit: Fit
    score: FloatArray
    information: FloatArray


def fit_profile(base: Base, kind: Kind, near: Start | None = None, again: Prior | None = None) -> Profile:
    """Fit the profile by Gauss-Newton steps around the events' modes; its evidence with nodes at the top.

    Climbed to under one prior after the other, as long as those left could matter; the evidence under them
    follows from the likelihood's slope and curvature at the tops. The most probable one is kept.

    Parameters
    ----------
    near : (values, (Population, points)), optional
        A profile, population and events' points: where to begin, beside no force. Far from what was
        recorded, robust errors see outliers and no direction to go.
    again : Prior, optional
        Under which to climb first: `near` is what was found for it by all of some avalanches, of which the
        base has a part. Fewer priors are climbed under then, and from one start each.
    """
    at = knots(base.setting)
    # Nothing like everything else, so that what is left of integration errors is the same there.
    none = np.zeros(len(at))
    nothing = _fit_at(base, kind, at, none, (base.population, base.fit.points))
    starts = [_peak(base, kind, at, none, nothing)]
    if near is not None:
        starts.append(_peak(base, kind, at, near[0], _fit_at(base, kind, at, *near)))
    height = nothing.found.log_evidence
    seen = _Seen(height, at, priors_of(kind, at))
    if again is None:
        waiting, climb, most = _first(kind, starts[-1], seen), _top, _PRIORS_TRIED
    else:
        waiting, climb, most = [again], _top_from_one, _PRIORS_AGAIN
    while waiting and len(seen.peaks) < most:
        prior = waiting.pop()
        seen.add(prior, climb(base, kind, at, [*starts, *seen.peaks.values()], prior.cover(at)))
        waiting = waiting or seen.open
    prior = max(seen.peaks, key=seen.factor)
    peak = seen.peaks[prior]
    cover = np.linalg.inv(peak.information + np.linalg.inv(prior.cover(at)))
    gain = peak.fit.found.log_evidence - height
    factor, cover = seen.log_factor, 0.5 * (cover + cover.T)
    return Profile(kind, prior, at, peak.values, cover, factor, gain, peak.fit, seen.hills)


def hill_at(base: Base, profile: Profile, values: FloatArray) -> Hill:
    """The hill that values are on, climbed under the prior that suits them best; its log factor is 0."""
    kind, at = profile.kind, profile.knots_m
    shares = priors_of(kind, at)
    prior = max(
        shares,
        key=lambda one: shares[one] + float(multivariate_normal(cov=one.cover(at)).logpdf(values)),
    )
    cover = prior.cover(at)
    fit = _fit_at(base, kind, at, values, _start(base, profile.fit))
    peak = _climb(base, kind, at, _peak(base, kind, at, values, fit), cover)
    left = np.linalg.inv(peak.information + np.linalg.inv(cover))
    return Hill(peak.values, 0.5 * (left + left.T), 0.0)


class _Promise(NamedTuple):
    """What slope and curvature at a peak say of a prior.

    Attributes
    ----------
    gain : float
        Of the log likelihood, at the most probable values under the prior.
    price : float
        Of those values.
    freedom : float
        Price of their freedom.
    values : (n_knots,) array
    covariance : (n_knots, n_knots) array
        Of what is left of their freedom.
    """

    gain: float
    price: float
    freedom: float
    values: FloatArray
    covariance: FloatArray

    def log_factor(self, most: float = math.inf) -> float:
        """Log Bayes factor if no values gain more than the most; at least that of no force at all."""
        return max(self._above_none(most), 0.0) - self.freedom

    def hill(self, most: float, log_factor: float) -> Hill:
        """Where values are; around none where no force at all is better."""
        mean = self.values if self._above_none(most) > 0.0 else np.zeros_like(self.values)
        return Hill(mean, self.covariance, log_factor)

    def _above_none(self, most: float) -> float:
        return min(self.gain, most) - self.price


class _Seen:
    """Peaks under some priors, and what they say of all of them.

    Where fronts stop, slope and curvature at one peak are a poor guide to another far away. A prior that was
    climbed under has its own factor; one about the same place as some that were, the least that they promise;
    any other the most that any peak promises, so that it is climbed under while it could matter. What is only
    promised in the end counts as if no values gained more than the best that were computed.
    """

    def __init__(self, height: float, at: FloatArray, priors: dict[Prior, float]) -> None:
        self.height = height
        self.shares = priors
        self.covers = {prior: prior.cover(at) for prior in priors}
        self.peaks: dict[Prior, _Peak] = {}
        self.promises: dict[Prior, dict[Prior, _Promise]] = {prior: {} for prior in priors}

    def add(self, climbed: Prior, peak: _Peak) -> None:
        """A peak under a prior."""
        self.peaks[climbed] = peak
        for prior, cover in self.covers.items():
            self.promises[prior][climbed] = _promise(peak, self.height, cover)

    def factor(self, prior: Prior, most: float = math.inf) -> float:
        """Log Bayes factor and log prior probability of a prior, as far as is known."""
        most = self._counted(prior, most)
        return self.promise(prior, most).log_factor(most) + self.shares[prior]

    def promise(self, prior: Prior, most: float = math.inf) -> _Promise:
        """What counts of what peaks say of a prior."""
        promises = self.promises[prior]
        if prior in promises:
            return promises[prior]
        near = [one for climbed, one in promises.items() if climbed.centre_m == prior.centre_m]
        if near:
            return min(near, key=lambda one: one.log_factor(most))
        return max(promises.values(), key=lambda one: one.log_factor(most))

    @property
    def open(self) -> list[Prior]:
        """The most probable prior not climbed under; none where all of those are improbable together.

        Nor where all priors are less probable than no force, even by what is promised.
        """
        left = {prior: self.factor(prior) for prior in self.shares if prior not in self.peaks}
        known = np.logaddexp.reduce([self.factor(prior) for prior in self.shares])
        if not left or known < _NO_FORCE or np.logaddexp.reduce(list(left.values())) < known - _SURE:
            return []
        return [max(left, key=lambda one: left[one])]

    @property
    def log_factor(self) -> float:
        """Log Bayes factor over all priors."""
        return float(np.logaddexp.reduce([self.factor(prior, self._most) for prior in self.shares]))

    @property
    def hills(self) -> tuple[Hill, ...]:
        """Where values may be, under each prior that is not far behind the most probable one."""
        factors = {prior: self.factor(prior, self._most) for prior in self.shares}
        least = max(factors.values()) - _MODES_WITHIN
        chosen = {prior: factor for prior, factor in factors.items() if factor > least}
        return tuple(
            self.promise(prior, self._most).hill(self._counted(prior, self._most), factor)
            for prior, factor in chosen.items()
        )

    def _counted(self, prior: Prior, most: float) -> float:
        """The most that values under a prior may gain: what was climbed to needs no limit."""
        return math.inf if prior in self.peaks else most

    @property
    def _most(self) -> float:
        """The most that any values computed have gained."""
        most = max(peak.fit.found.log_evidence - self.height for peak in self.peaks.values())
        return max(most, 0.0)


def _promise(peak: _Peak, height: float, cover: FloatArray) -> _Promise:
    """What a peak, perhaps one under another prior, says of a prior of this covariance."""
    precision = np.linalg.inv(cover)
    left = np.linalg.inv(peak.information + precision)
    step = left @ (peak.score - precision @ peak.values)
    gain = peak.fit.found.log_evidence - height + peak.score @ step - 0.5 * step @ peak.information @ step
    values, price = peak.values + step, _price(peak.values + step, precision)
    return _Promise(float(gain), price, _freedom(peak, cover), values, 0.5 * (left + left.T))


def _highest(peaks: Sequence[_Peak], cover: FloatArray) -> _Peak:
    """The one with the highest posterior under a prior."""
    precision = np.linalg.inv(cover)
    return max(peaks, key=lambda one: one.fit.found.log_evidence - _price(one.values, precision))


def _first(kind: Kind, start: _Peak, seen: _Seen) -> list[Prior]:
    """Under which priors to climb whatever is promised: the usual one, and last, that is first, one more.

    Where a start is more probable than no force, the prior under which it is most so.
    """
    usual = Prior(kind.amplitude, NEAR_M)
    gain = start.fit.found.log_evidence - seen.height
    price = {prior: _price(start.values, np.linalg.inv(cover)) for prior, cover in seen.covers.items()}
    if gain <= min(price.values()):
        return [usual]
    freedom = {prior: _freedom(start, cover) for prior, cover in seen.covers.items()}
    own = max(price, key=lambda prior: seen.shares[prior] - price[prior] - freedom[prior])
    return [usual, own] if own != usual else [usual]


def _price(values: FloatArray, precision: FloatArray) -> float:
    """What a prior takes off the log density of values."""
    return 0.5 * float(values @ precision @ values)


def _top(base: Base, kind: Kind, at: FloatArray, starts: Sequence[_Peak], cover: FloatArray) -> _Peak:
    """The top under a prior, from the start with the highest posterior and from the one that fits best.

    Sharp edges of a listed shape cost more under a smooth prior than they gain; but where recordings are far
    from what no force does, there may be no other way up.
    """
    top = _top_from_one(base, kind, at, starts, cover)
    best = max(starts, key=lambda one: one.fit.found.log_evidence)
    if best.fit.found.log_evidence < top.fit.found.log_evidence + _SURE:
        return top
    return _highest([top, _climb(base, kind, at, best, cover)], cover)


def _top_from_one(
    base: Base, kind: Kind, at: FloatArray, starts: Sequence[_Peak], cover: FloatArray
) -> _Peak:
    """The top under a prior, from the start with the highest posterior."""
    return _climb(base, kind, at, _highest(starts, cover), cover)


def _freedom(peak: _Peak, cover: FloatArray) -> float:
    """What the freedom of values under a prior takes off the log evidence."""
    _, log_det = np.linalg.slogdet(np.eye(len(cover)) + cover @ peak.information)
    return 0.5 * float(log_det)


def _climb(base: Base, kind: Kind, at: FloatArray, peak: _Peak, cover: FloatArray) -> _Peak:
    """To the top of the posterior under a prior."""
    precision = np.linalg.inv(cover)
    for _ in range(_ROUNDS):
        step = np.linalg.solve(peak.information + precision, peak.score - precision @ peak.values)
        height = peak.fit.found.log_evidence - _price(peak.values, precision)
        promised = 0.5 * float(step @ (peak.score - precision @ peak.values))
        for share in _SHARES:
            if share * (2.0 - share) * promised < _SETTLED:
                return _at_top(peak, precision)
            values = peak.values + share * step
            fit = _fit_at(base, kind, at, values, _start(base, peak.fit))
            gained = fit.found.log_evidence - _price(values, precision) - height
            if gained > 0.0:
                break
        else:
            break
        peak = _peak(base, kind, at, values, fit)
        if gained < _SETTLED:
            break
    return _at_top(peak, precision)


def _at_top(peak: _Peak, precision: FloatArray) -> _Peak:
    """A peak that was climbed to: a slope that is left over, at kinks where fronts stop, promises none."""
    return replace(peak, score=precision @ peak.values)


def _start(base: Base, fit: Fit) -> tuple[Population, FloatArray]:
    return fit.found.population(len(base.law.mechanisms)), fit.points


def as_profile(base: Base, kind: Kind, near: Curve) -> Start:
    """A listed mechanism that enters like a kind, at its best strength: values at the knots, and its fit."""
    at, top = knots(base.setting), int(np.argmax(near.log_evidence))
    edge = np.asarray(base.setting.terrain.edge_s_m)
    profile = near.direction.profiles[near.direction.columns.index(kind.column)]
    cells = hats(base.setting.terrain, at) * np.diff(edge)
    values = near.strengths[top] * (cells @ profile) / np.maximum(cells.sum(axis=1), 1e-9)
    return values, _start(base, near.fits[top])


def _fit_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Fit:
    """Population and events with the profile in."""
    direction = combined(base.setting, kind, at, values)
    extension = extended(base.problem, base.law, [*base.directions, direction])
    strengths = np.append(base.strengths, 1.0)[None, :]
    return refit(extension, base.rows, strengths, start, Rounds(least=1))[0]


def _peak(base: Base, kind: Kind, at: FloatArray, values: FloatArray, fit: Fit) -> _Peak:
    """With efficient score and information of the knots' values at what they are."""
    wide = knot_by_knot(base, kind, at)
    population, points = _start(base, fit)
    around = look_around(EventLikelihood(wide, base.rows, np.concatenate([base.strengths, values])), points)
    found = efficient_scores(around, base.rows, population, mean_prior(base.law))
    n_before = len(base.directions)
    return _Peak(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])
