"""One mechanism in the comparison: its evidence, strength and place, over all its shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.ways import Looked, Ways, gains_over, over_ways
from skred.diagnosis.discrepancy.profile import Profile
from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.evidence.tolerance import COUNTS, DECIDES_NOTHING
from skred.inference.between_events import PRIOR, BetweenEvents
from skred.inference.intervals import LEFT_OUT
from skred.physics.mechanisms.spec import Group, Mechanism
from skred.physics.mechanisms.stretches import is_opposed

FORM = 0.3
"""Relative standard deviation of a physical strength for the form of its term: edges, exponents, supply that
real forces have otherwise. Set on 28 opened trials, whose true forms differ on purpose: 90 % intervals held
16 of the true strengths without it, 24 with it."""
BESIDE = 0.5
"""Prior probability that a force in no list acts beside a mechanism, where such a force, by itself or beside
another one, has more evidence than it: then something acts beside it or in its place, at even odds."""


def with_or_without(own: float, both: float) -> float:
    """Log evidence of a mechanism where a force may act beside it, from that of it alone and of both."""
    return float(np.logaddexp(math.log1p(-BESIDE) + own, math.log(BESIDE) + both))


class Beside(NamedTuple):
    """A force not in the list beside a mechanism.

    Attributes
    ----------
    curve : Curve
        Of the mechanism's shape.
    profiles : tuple of Profile
        Of each kind, the evidence that of both against neither.
    """

    curve: Curve
    profiles: tuple[Profile, ...]


class Strength(NamedTuple):
    """Posterior mean and standard deviation of a strength, in its unit."""

    mean: float
    sd: float


@dataclass(frozen=True, eq=False)
class Candidate:
    """One mechanism in the comparison, under one error model.

    Attributes
    ----------
    curves : tuple of Curve
        One for each shape.
    log_weights : (n_curves,) array
        What each shape's evidence counts for: its prior probability; of a place that of its part of all
        places, times one number for all that makes their sum the mean over what lies between. It stays near
        the truth where the evidence becomes another one.
    correction : float
        What many more quadrature points, and importance sampling over the population, change along the best
        curves, in nats; 0 where not looked at.
    error : float or None
        Standard error of the log Bayes factor by importance sampling, in nats; None where not looked at.
    residue : float or None
        Log Bayes factor of a force not in the list beside it; None where not looked at.
    beside : Beside or None
        That force beside the most probable form of the mechanism's shapes.
    looked : tuple of Looked
        Where avalanches may differ in the strength; none where that was not looked at.
    of_places : float
        What stated errors of sensors' places change, less what they change for nothing, in nats.
    strength_with_places : Strength or None
        As `strength`, the shifts of such sensors fitted together with it; None where there are none, or where
        it would be below nil.
    log_between : (n_curves,) array or float
        Log of what each place adds to that mean, over what it adds by its weight.
    """

    mechanism: Mechanism
    curves: tuple[Curve, ...]
    log_weights: FloatArray
    correction: float = 0.0
    error: float | None = None
    residue: float | None = None
    beside: Beside | None = None
    looked: tuple[Looked, ...] = ()
    of_places: float = 0.0
    strength_with_places: Strength | None = None
    log_between: FloatArray | float = 0.0

    @property
    def log_factors(self) -> FloatArray:
        """Log of what each shape adds to the Bayes factor, with what lies between it and others."""
        return self.log_weights + np.array([one.log_bayes_factor for one in self.curves]) + self.log_between

    @property
    def alone(self) -> float:
        """Log Bayes factor against nothing, over shapes and strengths in common, no force beside it."""
        return float(np.logaddexp.reduce(self.log_factors)) + self.correction + self.of_places

    @property
    def log_bayes_factor(self) -> float:
        """Against nothing; differing, or with a force not in the list beside it, as far as is probable."""
        own = self.by_itself
        return own if self.residue is None else with_or_without(own, self.alone + self.residue)

    @property
    def by_itself(self) -> float:
        """The same without such a force."""
        return self.alone + (0.0 if self.gains is None else over_ways(self.gains))

    @property
    def gains(self) -> dict[BetweenEvents, float] | None:
        """What each way has more than the strength in common, in nats; None where not looked at."""
        return gains_over(self.looked) if any(one.ways for one in self.looked) else None

    @property
    def between(self) -> dict[BetweenEvents, float]:
        """Probability of each way in which avalanches may differ in the strength."""
        gains = self.gains or {BetweenEvents.COMMON: 0.0}
        heights = np.array([math.log(PRIOR[kind]) + gain for kind, gain in gains.items()])
        shares = np.exp(heights - np.logaddexp.reduce(heights))
        return dict.fromkeys(BetweenEvents, 0.0) | dict(zip(gains, shares.tolist(), strict=True))

    @property
    def likely_ways(self) -> tuple[BetweenEvents, ...]:
        """How avalanches may differ, the most probable way first; none that a credible set leaves out."""
        shares = self.between
        likely = [kind for kind in shares if shares[kind] > LEFT_OUT]
        return tuple(sorted(likely, key=lambda kind: -shares[kind]))

    @property
    def shape_weights(self) -> FloatArray:
        """Posterior probability of each shape; where avalanches may differ, with what its kind gains so."""
        factors = self.log_factors - np.logaddexp.reduce(self.log_factors)
        kinds = [all_but_place(one) for one in self.curves]
        for one in self.looked:
            own = np.array([kind == all_but_place(one.curve) for kind in kinds])
            factors[own] += one.height - np.logaddexp.reduce(factors[own])
        return np.exp(factors - np.logaddexp.reduce(factors))

    @property
    def leading(self) -> Looked | None:
        """The most probable shape of those looked at, strengths in common or not."""
        return max(self.looked, key=lambda one: one.height, default=None)

    @property
    def best(self) -> Curve:
        """The curve of the most probable shape; of the highest Bayes factor where none may differ."""
        return self.leading.curve if self.leading else max(self.curves, key=lambda one: one.log_bayes_factor)

    @property
    def ways(self) -> Ways | None:
        """Each way in which avalanches differ in the strength, at the best shape; None: not looked at."""
        return self.leading.ways if self.leading else None

    @property
    def to_look_closer(self) -> list[Looked]:
        """Shapes that may lead, strengths in common or not, and are not by many quadrature points yet."""
        if not self.looked:
            return []
        least = max(one.height for one in self.looked) - DECIDES_NOTHING
        in_common = max(self.looked, key=lambda one: one.log_share)
        leading = [one for one in self.looked if one is in_common or one.height > least]
        return [one for one in leading if one.error is None]

    def looked_closer(self, closer: Mapping[Looked, Looked]) -> Candidate:
        """With some of the shapes that were looked at by many more quadrature points."""
        looked = tuple(closer.get(one, one) for one in self.looked)
        before, after = (
            np.logaddexp.reduce([one.log_share for one in all_]) for all_ in (self.looked, looked)
        )
        found = replace(self, looked=looked, correction=self.correction + float(after - before))
        return replace(found, error=found.leading.error if found.leading else None)

    def with_places(self, alone: float, beside: float | None, strength: Strength | None) -> Candidate:
        """With what stated places change: for the mechanism, for it with a force beside it (both in nats).

        And with its strength at the best shape. What it leaves then is no residue any more where that is more
        than what it explains.
        """
        everywhere = None if strength is None else self.over_places(*strength)
        found = replace(self, of_places=alone, residue=None, strength_with_places=everywhere)
        if self.residue is None or beside is None:
            return found
        residue = self.residue + beside - alone
        return replace(found, residue=residue) if residue < found.log_bayes_factor else found

    def best_of_each(self, form: Callable[[Curve], Hashable]) -> list[tuple[Curve, float]]:
        """The best curve of each form that shapes have, and the log of the form's posterior probability.

        Both with a strength in common. None that is farther behind than what counts.

        Parameters
        ----------
        form : callable
            What shapes of one form share.
        """
        factors, of = self.log_factors, [form(one) for one in self.curves]
        weights = np.exp(factors - np.logaddexp.reduce(factors))
        found = list[tuple[Curve, float]]()
        for each in dict.fromkeys(of):
            own = [k for k in range(len(of)) if of[k] == each]
            log_share = math.log(max(float(weights[own].sum()), 1e-300))
            if log_share > -COUNTS:
                best = max(own, key=lambda k: self.curves[k].log_bayes_factor)
                found.append((self.curves[best], log_share))
        return found

    def strength(self) -> Strength:
        """The strength by the comparison, over all places."""
        return self.over_places(*self.best.moments)

    def over_places(self, mean: float, sd: float) -> Strength:
        """The strength over all places, from what it is at the best one.

        A mixture over the shapes whose strengths are the same quantity: of one sensor, one covariate, one
        speed scale, compensated or not. What their means differ by moves the mean and is in the standard
        deviation; so is what no comparison knows of, that a term stands for a force of a somewhat other form.

        Parameters
        ----------
        mean, sd : float
            Of the strength at the best shape.
        """
        best = self.best
        same = [k for k, one in enumerate(self.curves) if _quantity(one) == _quantity(best)]
        weights = self.shape_weights[same] / self.shape_weights[same].sum()
        apart = np.array([self.curves[k].moments[0] - best.moments[0] for k in same])
        moved = float(weights @ apart)
        between = math.sqrt(float(weights @ (apart - moved) ** 2))
        mean += moved
        form = FORM * abs(mean) if self.mechanism.group is Group.PHYSICS else 0.0
        return Strength(mean, math.hypot(sd, between, form))

    def ends(self, share: float) -> tuple[float, float] | None:
        """Quantiles of both ends over the place's posterior [m], None where it is not local."""
        if self.best.shape.place_m is None:
            return None
        ends = np.array([(one.shape.s_from_m, one.shape.s_to_m) for one in self.curves], dtype=float)
        weights = self.shape_weights
        first, last = (
            float(np.quantile(side, share, weights=weights, method="inverted_cdf")) for side in ends.T
        )
        return first, last


def names_of_constants(curve: Curve) -> Hashable:
    """Which constants a shape's term has, whatever their values: an obstacle's loss or its J, say."""
    return tuple(name for name, _ in curve.shape.constants)


def all_but_place(curve: Curve) -> Hashable:
    """What shapes of one kind share: the quantity that strengths are, which constants, where they begin.

    They differ in where a stretch is, and in values of constants.
    """
    return *_quantity(curve), names_of_constants(curve), curve.shape.begins_m


def _quantity(curve: Curve) -> tuple[str | None, str | None, bool, float | None]:
    """What a shape's strength is: the same quantity where this is the same."""
    shape = curve.shape
    return shape.sensor, shape.covariate, is_opposed(shape), curve.direction.weakening_speed
