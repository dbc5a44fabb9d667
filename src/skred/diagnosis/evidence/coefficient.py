"""The evidence along the strength of an added mechanism: everything else refitted at each value.

No derivative by the strength is taken at nothing: base strengths and scatter can absorb a strong effect,
which shows only where it is added.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Population,
    Rows,
    campaign_rows,
    event_modes,
    log_joint,
)
from skred.diagnosis.evidence.event_quadrature import FIRST, USUAL, Budget
from skred.diagnosis.evidence.extension import Extension, extended, setting_of, typical_speed
from skred.diagnosis.evidence.linear_mixed_model import median_log_scale
from skred.diagnosis.evidence.marginal import coordinates, evidence, population_at
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.evidence.tolerance import COUNTS, MOST_ROUNDS
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.surface import Nodes
from skred.physics.law import Law
from skred.physics.mechanisms.placed import PlacedMechanism, placed
from skred.physics.mechanisms.spec import Direction, Setting, Shape
from skred.physics.mechanisms.strength_prior import SCALES, log_prior_density

NEAR = (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0)
"""Strengths around what was found before, in its standard deviations: a normal posterior has fallen by eight
nats at the ends, more than `COUNTS`."""
_SMALLEST = 1e-3
"""Strength, and standard deviation of one, below which nothing is told apart, in scales of the mechanism."""
_BETWEEN = 60
"""Points at which a curve is integrated between each two strengths."""
_DEEP = 40.0
"""Nats below the maximum from which on evidence counts as equally small."""
_FARTHER = (1.4, 2.0)
"""How many times as far a curve is followed beyond an end: a climb can end long before the maximum."""


@dataclass(frozen=True, eq=False)
class Base:
    """The law that mechanisms are added to, fitted.

    Attributes
    ----------
    directions : tuple of Direction
        Already in, with `strengths`.
    strengths : (n_directions,) array
    """

    problem: HierarchicalProblem
    law: Law
    setting: Setting
    rows: Rows
    fit: Fit
    directions: tuple[Direction, ...] = ()
    strengths: FloatArray = field(default_factory=lambda: np.empty(0))
    _nothing: dict[tuple[Budget, bool], Fit] = field(default_factory=dict, init=False, repr=False)

    @property
    def log_scale(self) -> FloatArray:
        """Logarithm of the scales of the medians' priors."""
        return median_log_scale(self.law)

    @property
    def population(self) -> Population:
        """The most probable population."""
        return self.fit.population

    def plain(self) -> Base:
        """The base law without what was added before."""
        return replace(self, directions=(), strengths=np.empty(0))

    def with_in(self, direction: Direction, strength: float, fit: Fit) -> Base:
        """The law with one thing more in, fitted."""
        strengths = np.append(self.strengths, strength)
        return replace(self, directions=(*self.directions, direction), strengths=strengths, fit=fit)

    def extended(self, *more: Direction) -> Extension:
        """The law with what is in already, and with more."""
        return extended(self.problem, self.law, (*self.directions, *more))

    def given(self, added: FloatArray) -> FloatArray:
        """Strengths of what is in already before some of what is added, (n, n_added) to (n, n_directions)."""
        return np.column_stack([np.tile(self.strengths, (len(added), 1)), added])

    def with_nothing(self, budget: Budget, *, sampled: bool = False) -> Fit:
        """Refitted with nothing added, as `curve_at` does with something: the same for all mechanisms.

        Always from the base's own fit. From that of another curve it can come to a lower mode, and then
        everything has nats that are not there.
        """
        if (budget, sampled) not in self._nothing:
            given, rounds = self.strengths[None, :], Rounds(budget, FIRST, sampled=sampled)
            fits = refit(self.extended(), self.rows, given, self.fit.start, rounds)
            self._nothing[budget, sampled] = fits[0]
        return self._nothing[budget, sampled]


@dataclass(frozen=True, eq=False)
class Curve(PlacedMechanism):
    """Evidence along the strength of one mechanism of one shape.

    Attributes
    ----------
    strengths : (n,) array
        In the strength's unit, increasing, 0 among them.
    log_evidence : (n,) array
        Relative to strength 0.
    fits : tuple of Fit
        One for each strength.
    """

    strengths: FloatArray
    log_evidence: FloatArray
    fits: tuple[Fit, ...]

    def nearest(self, strength: float) -> Fit:
        """The fit at the strength closest to one."""
        return _closest(self.known, strength)

    @property
    def top(self) -> tuple[float, Fit]:
        """The strength with most evidence, and the fit there."""
        number = int(np.argmax(self.log_evidence))
        return float(self.strengths[number]), self.fits[number]

    @property
    def known(self) -> dict[float, Fit]:
        """The fits by strength."""
        return dict(zip(self.strengths.tolist(), self.fits, strict=True))

    def fine(self, scales: Sequence[float] = SCALES) -> tuple[FloatArray, FloatArray]:
        """Strengths on a fine grid, and the log posterior density there, not normalised."""
        # As many between each two that were computed: these lie close where the curve is narrow.
        parts = np.linspace(self.strengths[:-1], self.strengths[1:], _BETWEEN, endpoint=False, axis=1)
        strengths = np.append(parts.ravel(), self.strengths[-1])
        # Of a monotone spline: others overshoot where two strengths nearly coincide.
        heights = PchipInterpolator(self.strengths, self._heights)(strengths)
        return strengths, heights + self.log_prior(strengths, scales)

    def log_prior(self, strengths: FloatArray, scales: Sequence[float] = SCALES) -> FloatArray:
        """Log density of the strength's prior, of some scales in its mechanism's."""
        return log_prior_density(strengths, self.scale, either_sign=self.added.either_sign, scales=scales)

    @property
    def open_ends(self) -> FloatArray:
        """Strengths at ends, but 0, beyond which the posterior may go on: it rises there, or is not small."""
        density = self._heights + self.log_prior(self.strengths)
        ends, inward = density[[0, -1]], density[[1, -2]]
        on = (ends > inward) | (ends > density.max() - COUNTS)
        strengths: FloatArray = self.strengths[[0, -1]]
        return strengths[on & (strengths != 0.0)]

    def with_more(self, other: Curve) -> Curve:
        """With those strengths of another curve of the same shape that lie outside of its own."""
        own = self.strengths[self.strengths != 0.0]
        outside = (other.strengths < own.min()) | (other.strengths > own.max())
        more = np.flatnonzero(outside & (other.strengths != 0.0))
        strengths = np.append(self.strengths, other.strengths[more])
        order = np.argsort(strengths)
        heights = np.append(self.log_evidence, other.log_evidence[more])[order]
        every = (*self.fits, *(other.fits[k] for k in more))
        fits = tuple(every[k] for k in order)
        return replace(self, strengths=strengths[order], log_evidence=heights, fits=fits)

    @property
    def floor(self) -> float:
        """Log evidence that all counts for which has less."""
        return float(self.log_evidence.max()) - _DEEP

    @property
    def _heights(self) -> FloatArray:
        """Log evidence, nowhere less than the floor."""
        return np.maximum(self.log_evidence, self.floor)

    @cached_property
    def log_bayes_factor(self) -> float:
        """Against strength 0, in nats."""
        return self.log_factor_of()

    def log_factor_of(self, sign: float = 0.0, scales: Sequence[float] = SCALES) -> float:
        """Against strength 0, in nats, by strengths of one sign alone, or with a prior of other scales."""
        strengths, log_density = self.fine(scales)
        own = strengths * sign >= 0.0
        most = float(log_density.max())
        return most + math.log(float(np.trapezoid(np.exp(log_density[own] - most), strengths[own])))

    @property
    def sign(self) -> float:
        """That of the mean."""
        return math.copysign(1.0, self.moments[0])

    @cached_property
    def moments(self) -> tuple[float, float]:
        """Posterior mean and standard deviation of the strength, if the mechanism is there."""
        strengths, log_density = self.fine()
        density = np.exp(log_density - log_density.max())
        density /= np.trapezoid(density, strengths)
        mean = float(np.trapezoid(density * strengths, strengths))
        return mean, math.sqrt(float(np.trapezoid(density * (strengths - mean) ** 2, strengths)))


def curve_near(base: Base, near: Curve, shape: Shape) -> Curve:
    """Evidence along the strength of a mechanism, around where another curve has it.

    Parameters
    ----------
    near : Curve
        Of the same mechanism and nearly the same shape.
    """
    candidate = placed(near.mechanism, base.setting, shape)
    least, found = _SMALLEST * candidate.scale, None
    for _ in range(MOST_ROUNDS):
        before = near.moments
        around = curve_at(base, candidate, _strengths_near(near), USUAL, near.known)
        near = found = followed(base, around if found is None else around.with_more(found), USUAL)
        after = near.moments
        sd = max(before[1], least), max(after[1], least)
        if abs(after[0] - before[0]) < sd[0] and 0.5 < sd[1] / sd[0] < 2.0:
            break
    return near


def followed(base: Base, curve: Curve, budget: Budget) -> Curve:
    """A curve with strengths farther and farther beyond each end at which its posterior may go on."""
    for _ in range(MOST_ROUNDS):
        if not len(ends := curve.open_ends):
            break
        beyond = np.multiply.outer(ends, _FARTHER).ravel()
        curve = curve.with_more(curve_at(base, curve, beyond, budget, begin=curve.known))
    return curve


def _strengths_near(near: Curve) -> FloatArray:
    """Strengths around the mean of a curve, without 0, as far apart as it says."""
    mean, sd = near.moments
    sd = max(sd, _SMALLEST * near.scale)
    strengths = mean + sd * np.array(NEAR)
    if abs(mean) > 2.0 * abs(NEAR[0]) * sd:  # nothing between 0 and there otherwise
        strengths = np.append(strengths, 0.5 * (mean - math.copysign(abs(NEAR[0]) * sd, mean)))
    return strengths if near.added.either_sign else strengths[strengths > 0.05 * sd]


def curve_at(
    base: Base,
    candidate: PlacedMechanism,
    strengths: FloatArray,
    budget: Budget = USUAL,
    known: Mapping[float, Fit] | None = None,
    begin: Mapping[float, Fit] | None = None,
    sampled: bool = False,
) -> Curve:
    """Evidence along the strength of a mechanism, at some strengths and at 0.

    Parameters
    ----------
    known : mapping of float to Fit, optional
        Fits by strength, of the same mechanism and nearly the same shape: the closest is where each refit
        begins, and one round goes on from it.
    begin : mapping of float to Fit, optional
        The same, of other places or of a linear model: where refits begin that go all their rounds; else they
        begin with the base's.
    sampled : bool
        Whether the evidence is computed by importance sampling; else by Laplace's formula.
    """
    strengths = np.sort(strengths[np.abs(strengths) > _SMALLEST * candidate.scale])
    fits = known or begin
    near = None if fits is None else [_closest(fits, strength) for strength in strengths]
    rounds = Rounds(budget, FIRST, sampled=sampled) if known is None else Rounds(budget, None, 1, sampled)
    given = base.given(strengths)
    found = refit(base.extended(candidate.direction), base.rows, given, base.fit.start, rounds, near)
    place = int(np.searchsorted(strengths, 0.0))
    found.insert(place, base.with_nothing(budget, sampled=sampled))
    strengths = np.insert(strengths, place, 0.0)
    heights = np.array([fit.found.log_evidence for fit in found])
    heights = np.nan_to_num(heights - heights[place], nan=-1e3, neginf=-1e3)
    return Curve(candidate.mechanism, candidate.shape, candidate.direction, strengths, heights, tuple(found))


def _closest(fits: Mapping[float, Fit], strength: float) -> Fit:
    """The fit at the strength closest to one."""
    return fits[min(fits, key=lambda one: abs(one - strength))]


def fit_base(
    problem: HierarchicalProblem,
    law: Law,
    population: Population,
    points: FloatArray | None = None,
) -> Base:
    """The base law fitted, from roughly where its population is.

    The population is that of the law's likelihood surfaces, in which no mode is missed.
    """
    extension = extended(problem, law)
    rows = campaign_rows(extension)
    if points is None:
        points = np.zeros((len(rows.event), len(law.mechanisms) + 1))
        points[:, :-1] = population.mean[0]
    nodes, none = problem.surfaces(law.mechanisms).nodes, np.empty(0)
    found = evidence(nodes, median_log_scale(law), coordinates(population), 30)
    exact = population_at(found.psi[None], len(law.mechanisms))
    starts = (points, _best_nodes(nodes, exact))
    likelihood = EventLikelihood(extension, rows, none)
    tried = [event_modes(likelihood, start, exact, n_steps=20).points for start in starts]
    heights = [log_joint(likelihood, one, exact) for one in tried]
    fit = Fit(found, np.where((heights[1] > heights[0])[:, None], tried[1], tried[0]))
    setting = setting_of(problem, law, typical_speed(extension.speeds(fit.points, none)))
    return Base(problem, law, setting, rows, fit, (), none)


def _best_nodes(nodes: Nodes, population: Population) -> FloatArray:
    """The node of each event's surface that the population makes most likely; releases as noted."""
    deviation = nodes.points - population.mean[0][:, None]
    white = np.linalg.solve(np.linalg.cholesky(population.covariance[0]), deviation)
    height = nodes.log_weights - 0.5 * np.sum(white**2, axis=0)
    best = [int(a + np.argmax(height[a:b])) for a, b in zip(nodes.first[:-1], nodes.first[1:], strict=True)]
    return np.column_stack([nodes.points[:, best].T, np.zeros(len(best))])
