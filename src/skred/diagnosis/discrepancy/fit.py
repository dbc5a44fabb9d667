"""The force that is not in the list, fitted, with its evidence over all of its priors.

Gauss-Newton steps, around the events' modes, lead to the maximum of the posterior under one prior after the
other; from there on by the Laplace approximation.
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
    Kind,
    Mode,
    Prior,
    Profile,
    combined,
    knot_by_knot,
    knots,
    priors_of,
    spline_basis,
)
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, look_around
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, mean_prior
from skred.diagnosis.evidence.refit import Fit, Rounds, refit

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
class _Maximum:
    """A profile's values, the fit with them, and score and information of the likelihood there."""

    values: FloatArray
    fit: Fit
    score: FloatArray
    information: FloatArray


def fit_profile(base: Base, kind: Kind, near: Start | None = None, again: Prior | None = None) -> Profile:
    """Fit the profile by Gauss-Newton steps around the events' modes; evidence by quadrature at the maximum.

    One prior is tried after the other, as long as those left could matter. The evidence under the others
    follows from score and information at the maxima that were found. The most probable prior is kept.

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
    starts = [_around(base, kind, at, none, nothing)]
    if near is not None:
        starts.append(_around(base, kind, at, near[0], _fit_at(base, kind, at, *near)))
    height = nothing.found.log_evidence
    explored = _Explored(height, at, priors_of(kind, at))
    if again is None:
        waiting, climb, most = _first(kind, starts[-1], explored), _maximum_under, _PRIORS_TRIED
    else:
        waiting, climb, most = [again], _maximum_from_one, _PRIORS_AGAIN
    while waiting and len(explored.maxima) < most:
        prior = waiting.pop()
        explored.add(prior, climb(base, kind, at, [*starts, *explored.maxima.values()], prior.cover(at)))
        waiting = waiting or explored.open
    prior = max(explored.maxima, key=explored.factor)
    maximum = explored.maxima[prior]
    cover = np.linalg.inv(maximum.information + np.linalg.inv(prior.cover(at)))
    gain = maximum.fit.found.log_evidence - height
    factor, cover = explored.log_factor, 0.5 * (cover + cover.T)
    return Profile(kind, prior, at, maximum.values, cover, factor, gain, maximum.fit, explored.modes)


def mode_at(base: Base, profile: Profile, values: FloatArray) -> Mode:
    """The mode near some values, under the prior that suits them best; its log factor is 0."""
    kind, at = profile.kind, profile.knots_m
    shares = priors_of(kind, at)
    prior = max(
        shares,
        key=lambda one: shares[one] + float(multivariate_normal(cov=one.cover(at)).logpdf(values)),
    )
    cover = prior.cover(at)
    fit = _fit_at(base, kind, at, values, _start(base, profile.fit))
    maximum = _climb(base, kind, at, _around(base, kind, at, values, fit), cover)
    left = np.linalg.inv(maximum.information + np.linalg.inv(cover))
    return Mode(maximum.values, 0.5 * (left + left.T), 0.0)


class _Laplace(NamedTuple):
    """The Laplace approximation of a prior's evidence, from score and information at a maximum.

    Attributes
    ----------
    gain : float
        Of the log likelihood, at the most probable values under the prior.
    prior_penalty : float
        What the prior takes off at those values.
    occam_penalty : float
        What it takes off for the room that it gives to all others.
    values : (n_knots,) array
    covariance : (n_knots, n_knots) array
        Of the values, by prior and recordings together.
    """

    gain: float
    prior_penalty: float
    occam_penalty: float
    values: FloatArray
    covariance: FloatArray

    def log_factor(self, most: float = math.inf) -> float:
        """Log Bayes factor if no values gain more than `most`; at least that of no force at all."""
        return max(self._above_none(most), 0.0) - self.occam_penalty

    def mode(self, most: float, log_factor: float) -> Mode:
        """Where values are; around none where no force at all is better."""
        mean = self.values if self._above_none(most) > 0.0 else np.zeros_like(self.values)
        return Mode(mean, self.covariance, log_factor)

    def _above_none(self, most: float) -> float:
        return min(self.gain, most) - self.prior_penalty


class _Explored:
    """Maxima under some priors, and what they say of all of them.

    Where fronts stop, score and information at one maximum are a poor guide to another far away. A prior that
    was climbed under has its own factor. One about the same place as some that were has the least of their
    approximations. Any other has the largest of all, so that it is climbed under while it could matter. What
    is only approximated in the end counts as if no values gained more than the best that were computed.
    """

    def __init__(self, height: float, at: FloatArray, priors: dict[Prior, float]) -> None:
        self.height = height
        self.shares = priors
        self.covers = {prior: prior.cover(at) for prior in priors}
        self.maxima: dict[Prior, _Maximum] = {}
        self.approximations: dict[Prior, dict[Prior, _Laplace]] = {prior: {} for prior in priors}

    def add(self, climbed: Prior, maximum: _Maximum) -> None:
        """A maximum under a prior."""
        self.maxima[climbed] = maximum
        for prior, cover in self.covers.items():
            self.approximations[prior][climbed] = _laplace(maximum, self.height, cover)

    def factor(self, prior: Prior, most: float = math.inf) -> float:
        """Log Bayes factor and log prior probability of a prior, as far as is known."""
        most = self._counted(prior, most)
        return self.approximation(prior, most).log_factor(most) + self.shares[prior]

    def approximation(self, prior: Prior, most: float = math.inf) -> _Laplace:
        """The approximation of a prior that counts, of those from all maxima."""
        approximations = self.approximations[prior]
        if prior in approximations:
            return approximations[prior]
        near = [one for climbed, one in approximations.items() if climbed.centre_m == prior.centre_m]
        if near:
            return min(near, key=lambda one: one.log_factor(most))
        return max(approximations.values(), key=lambda one: one.log_factor(most))

    @property
    def open(self) -> list[Prior]:
        """The most probable prior not climbed under; none where all of those are improbable together.

        Nor where all priors are less probable than no force, even by their approximations.
        """
        left = {prior: self.factor(prior) for prior in self.shares if prior not in self.maxima}
        known = np.logaddexp.reduce([self.factor(prior) for prior in self.shares])
        if not left or known < _NO_FORCE or np.logaddexp.reduce(list(left.values())) < known - _SURE:
            return []
        return [max(left, key=lambda one: left[one])]

    @property
    def log_factor(self) -> float:
        """Log Bayes factor over all priors."""
        return float(np.logaddexp.reduce([self.factor(prior, self._most) for prior in self.shares]))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Where values may be, under each prior that is not far behind the most probable one."""
        factors = {prior: self.factor(prior, self._most) for prior in self.shares}
        least = max(factors.values()) - _MODES_WITHIN
        chosen = {prior: factor for prior, factor in factors.items() if factor > least}
        return tuple(
            self.approximation(prior, self._most).mode(self._counted(prior, self._most), factor)
            for prior, factor in chosen.items()
        )

    def _counted(self, prior: Prior, most: float) -> float:
        """The most that values under a prior may gain: what was climbed to needs no limit."""
        return math.inf if prior in self.maxima else most

    @property
    def _most(self) -> float:
        """The most that any values computed have gained."""
        most = max(maximum.fit.found.log_evidence - self.height for maximum in self.maxima.values())
        return max(most, 0.0)


def _laplace(maximum: _Maximum, height: float, cover: FloatArray) -> _Laplace:
    """Of a prior with this covariance, from a maximum that may be under another prior."""
    precision = np.linalg.inv(cover)
    left = np.linalg.inv(maximum.information + precision)
    step = left @ (maximum.score - precision @ maximum.values)
    score, information = maximum.score, maximum.information
    gain = maximum.fit.found.log_evidence - height + score @ step - 0.5 * step @ information @ step
    values = maximum.values + step
    penalties = _prior_penalty(values, precision), _occam_penalty(maximum, cover)
    return _Laplace(float(gain), *penalties, values, 0.5 * (left + left.T))


def _highest(maxima: Sequence[_Maximum], cover: FloatArray) -> _Maximum:
    """The one with the highest posterior under a prior."""
    precision = np.linalg.inv(cover)
    return max(maxima, key=lambda one: one.fit.found.log_evidence - _prior_penalty(one.values, precision))


def _first(kind: Kind, start: _Maximum, explored: _Explored) -> list[Prior]:
    """Under which priors to climb in any case, the last one first: the usual one, and perhaps one more.

    Where a start is more probable than no force, the prior under which it is most so.
    """
    usual = Prior(kind.amplitude, NEAR_M)
    gain = start.fit.found.log_evidence - explored.height
    covers = explored.covers.items()
    penalty = {prior: _prior_penalty(start.values, np.linalg.inv(cover)) for prior, cover in covers}
    if gain <= min(penalty.values()):
        return [usual]
    occam = {prior: _occam_penalty(start, cover) for prior, cover in covers}
    own = max(penalty, key=lambda prior: explored.shares[prior] - penalty[prior] - occam[prior])
    return [usual, own] if own != usual else [usual]


def _prior_penalty(values: FloatArray, precision: FloatArray) -> float:
    """What a prior takes off the log density at some values."""
    return 0.5 * float(values @ precision @ values)


def _maximum_under(
    base: Base, kind: Kind, at: FloatArray, starts: Sequence[_Maximum], cover: FloatArray
) -> _Maximum:
    """The maximum under a prior, from the start with the highest posterior and from the one that fits best.

    Sharp edges of a listed shape cost more under a smooth prior than they gain; but where recordings are far
    from what no force does, there may be no other way up.
    """
    found = _maximum_from_one(base, kind, at, starts, cover)
    best = max(starts, key=lambda one: one.fit.found.log_evidence)
    if best.fit.found.log_evidence < found.fit.found.log_evidence + _SURE:
        return found
    return _highest([found, _climb(base, kind, at, best, cover)], cover)


def _maximum_from_one(
    base: Base, kind: Kind, at: FloatArray, starts: Sequence[_Maximum], cover: FloatArray
) -> _Maximum:
    """The maximum under a prior, from the start with the highest posterior."""
    return _climb(base, kind, at, _highest(starts, cover), cover)


def _occam_penalty(maximum: _Maximum, cover: FloatArray) -> float:
    """What the room that a prior gives to the values takes off the log evidence."""
    _, log_det = np.linalg.slogdet(np.eye(len(cover)) + cover @ maximum.information)
    return 0.5 * float(log_det)


def _climb(base: Base, kind: Kind, at: FloatArray, maximum: _Maximum, cover: FloatArray) -> _Maximum:
    """To the maximum of the posterior under a prior."""
    precision = np.linalg.inv(cover)
    for _ in range(_ROUNDS):
        step = np.linalg.solve(maximum.information + precision, maximum.score - precision @ maximum.values)
        height = maximum.fit.found.log_evidence - _prior_penalty(maximum.values, precision)
        expected = 0.5 * float(step @ (maximum.score - precision @ maximum.values))
        for share in _SHARES:
            if share * (2.0 - share) * expected < _SETTLED:
                return _arrived(maximum, precision)
            values = maximum.values + share * step
            fit = _fit_at(base, kind, at, values, _start(base, maximum.fit))
            gained = fit.found.log_evidence - _prior_penalty(values, precision) - height
            if gained > 0.0:
                break
        else:
            break
        maximum = _around(base, kind, at, values, fit)
        if gained < _SETTLED:
            break
    return _arrived(maximum, precision)


def _arrived(maximum: _Maximum, precision: FloatArray) -> _Maximum:
    """A maximum that was climbed to: a score that is left over, at kinks where fronts stop, leads nowhere."""
    return replace(maximum, score=precision @ maximum.values)


def _start(base: Base, fit: Fit) -> tuple[Population, FloatArray]:
    return fit.found.population(len(base.law.mechanisms)), fit.points


def as_profile(base: Base, kind: Kind, near: Curve) -> Start:
    """A listed mechanism that enters like a kind, at its best strength: values at the knots, and its fit."""
    at, best = knots(base.setting), int(np.argmax(near.log_evidence))
    edge = np.asarray(base.setting.terrain.edge_s_m)
    profile = near.direction.profiles[near.direction.columns.index(kind.column)]
    cells = spline_basis(base.setting.terrain, at) * np.diff(edge)
    values = near.strengths[best] * (cells @ profile) / np.maximum(cells.sum(axis=1), 1e-9)
    return values, _start(base, near.fits[best])


def _fit_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Fit:
    """Population and events with the profile in."""
    direction = combined(base.setting, kind, at, values)
    extension = extended(base.problem, base.law, [*base.directions, direction])
    strengths = np.append(base.strengths, 1.0)[None, :]
    return refit(extension, base.rows, strengths, start, Rounds(least=1))[0]


def _around(base: Base, kind: Kind, at: FloatArray, values: FloatArray, fit: Fit) -> _Maximum:
    """With efficient score and information of the knots' values at what they are."""
    wide = knot_by_knot(base, kind, at)
    population, points = _start(base, fit)
    around = look_around(EventLikelihood(wide, base.rows, np.concatenate([base.strengths, values])), points)
    found = efficient_scores(around, base.rows, population, mean_prior(base.law))
    n_before = len(base.directions)
    return _Maximum(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])
