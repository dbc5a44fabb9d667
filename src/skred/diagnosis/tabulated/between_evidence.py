"""The evidence of each way in which avalanches differ in an added strength.

An integral over the population, the strength, and what says how it differs, all at once; the events' own
strengths are integrated by tables. Importance sampling around the modes that are climbed to from several
starts: few avalanches with much and many with little are two. A strength that all have in common is not among
the ways: it would have to suit avalanches that have none of it, at strengths between tables and populations
that no table is around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from skred.arrays import FloatArray
from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode, weighted_draws
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.marginal import Evidence, curvatures
from skred.diagnosis.evidence.population_target import NARROWEST, factor_at, log_prior
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.tabulated.tables import Tables
from skred.diagnosis.tabulated.tabulated_op import tabulated_log_densities
from skred.inference.between_events import BetweenEvents, components, from_unbounded

_STARTS: dict[BetweenEvents, tuple[tuple[float, float], ...]] = {
    BetweenEvents.SPREAD: ((1.0, -1.6), (1.0, -0.3)),
    BetweenEvents.SOME: ((1.0, 2.5), (1.5, 0.5), (2.5, -0.8)),
}
"""Where climbs begin: multiples of the strength that all have in common, and the other's coordinate."""
_DIFFERENCE = 1e-3
"""Step of central differences, in coordinates whose scale is one or so."""
_SETTLED = 1e-5
"""Share of the log density by which a step must gain: some thousandths or hundredths of a nat."""
_BAD = -1e10
"""Height where there is none: a climb turns back, and differences stay finite."""


class Way(NamedTuple):
    """One way in which avalanches differ.

    Attributes
    ----------
    log_factor : float
        Log Bayes factor against nothing at the same shape, by as many quadrature points, over
        strengths of the sign that one in common has.
    populations : Evidence
        The way's own, with mean and covariance over its posterior.
    strength : (float, float)
        Mean and standard deviation over it.
    proposal : Mixture
        Adapted to it.
    farthest : float
        Size of the strength that each avalanche has less than, but for one in a hundred draws.
    """

    log_factor: float
    populations: Evidence
    strength: tuple[float, float]
    proposal: Mixture
    farthest: float


@dataclass(frozen=True, eq=False)
class BetweenTarget:
    """The density of population, strength and what says how avalanches differ in it, given tables.

    Coordinates are the population's, the logarithm of the strength's size, and that of `from_unbounded`.
    """

    base: Base
    curve: Curve
    tables: Tables
    kind: BetweenEvents

    @cached_property
    def end(self) -> float:
        """The farthest strength that there are tables for, with its sign."""
        return float(self.tables.grid.points[-1, 0])

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Populations, strengths, parameters, and log priors of the last two, from coordinates (n, size)."""
        n_psi = self.base.fit.found.psi.size
        size = np.exp(np.minimum(x[:, n_psi], 50.0))
        log_p = self.curve.log_prior(size) + x[:, n_psi]
        log_p = np.where(size <= abs(self.end), log_p, -np.inf)
        parameter, more = from_unbounded(self.kind, x[:, n_psi + 1])
        return x[:, :n_psi], np.copysign(size, self.end), parameter, log_p + more

    def __call__(self, x: FloatArray) -> FloatArray:
        """Log density at coordinates, (n, size) to (n,); not normalised by the evidence."""
        psi, strength, parameter, log_p = self.split(x)
        n = len(self.base.law.mechanisms)
        inside = np.isfinite(log_p) & (psi[:, n : 2 * n] >= NARROWEST).all(axis=1)
        result = np.full(len(x), -np.inf)
        if not inside.any():
            return result
        _, densities = self._of_events(psi[inside], strength[inside], parameter[inside])
        total = np.logaddexp.reduce(densities, axis=1).sum(axis=1)
        total += [log_prior(one, n, self.base.log_scale) for one in psi[inside]]
        total += log_p[inside]
        result[inside] = np.where(np.isnan(total), -np.inf, total)
        return result

    def _of_events(
        self, psi: FloatArray, strength: FloatArray, parameter: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Strengths that avalanches may have, (n, n_components), and the events' log densities with each.

        The latter with its share, (n, n_components, n_events).
        """
        n = len(self.base.law.mechanisms)
        means, factors = psi[:, :n].copy(), np.array([factor_at(one, n) for one in psi])
        own, log_shares = components(self.kind, strength, parameter)
        densities = tabulated_log_densities(
            means, factors, np.ascontiguousarray(own[:, :, None]), len(self.base.rows.event),
            *self.tables.arrays.values(),
        )  # fmt: skip
        return own, densities + log_shares[:, :, None]

    def farthest(self, x: FloatArray, shares: FloatArray) -> float:
        """Size of the strength that each avalanche has less than, but for one in a hundred draws.

        Parameters
        ----------
        x, shares : (n, size) and (n,) arrays
            Weighted draws of the coordinates.
        """
        psi, strength, parameter, _ = self.split(x)
        own, densities = self._of_events(psi, strength, parameter)
        of_each = shares[:, None, None] * np.exp(densities - np.logaddexp.reduce(densities, axis=1)[:, None])
        sizes = np.abs(own).ravel()
        order = np.argsort(sizes)
        up_to = of_each.reshape(len(sizes), -1)[order].cumsum(axis=0)
        return float(sizes[order[(up_to < 0.99).sum(axis=0).max().clip(max=len(sizes) - 1)]])


def searched_evidence(target: BetweenTarget, near: Evidence) -> Way:
    """One way, by draws around its modes, which are looked for.

    Parameters
    ----------
    near : Evidence
        Populations around a mode.
    """
    mean, sd = target.curve.moments
    log_size = math.log(abs(mean) + sd)
    most = math.log(0.9 * abs(target.end))
    tops = []
    for multiple, coordinate in _STARTS[target.kind]:
        start = [*near.psi, min(log_size + math.log(multiple), most), coordinate]
        tops.append(_climbed(target, np.array(start)))
    heights = target(np.array(tops))
    near_highest = np.flatnonzero(heights >= heights.max() - COUNTS)
    modes = [Mode(tops[k], _curvature(target, tops[k])) for k in near_highest]
    return between_evidence(target, Mixture.on(modes), 71)


def between_evidence(target: BetweenTarget, proposal: Mixture, seed: int = 72) -> Way:
    """One way, from a proposal that may be by other tables; `seed` is of its draws."""
    found = weighted_draws(target, proposal, np.random.default_rng([0, seed]))
    shares = found.shares
    psi, strengths, _, _ = target.split(found.draws)
    middle, moments = float(shares @ strengths), found._replace(draws=psi).moments
    populations = Evidence(found.log_integral, *moments, found.error)
    sd = math.sqrt(float(shares @ (strengths - middle) ** 2))
    nothing = target.base.with_nothing(target.tables.budget, sampled=True).found.log_evidence
    log_factor = found.log_integral - nothing
    counted = shares > 0.0
    farthest = target.farthest(found.draws[counted], shares[counted])
    return Way(log_factor, populations, (middle, sd), found.proposal, farthest)


def _climbed(target: BetweenTarget, start: FloatArray) -> FloatArray:
    """The maximum that a climb from a start comes to."""

    def value_and_slope(x: FloatArray) -> tuple[float, FloatArray]:
        steps = _DIFFERENCE * np.eye(len(x))
        heights = np.maximum(target(np.vstack([x[None], x + steps, x - steps])), _BAD)
        n = len(x)
        return -float(heights[0]), -(heights[1 : n + 1] - heights[n + 1 :]) / (2.0 * _DIFFERENCE)

    found = minimize(value_and_slope, start, jac=True, method="L-BFGS-B", tol=_SETTLED)
    return np.asarray(found.x)


def _curvature(target: BetweenTarget, top: FloatArray) -> FloatArray:
    """Covariance by the Laplace approximation at a mode, by differences."""
    n, step = len(top), 30.0 * _DIFFERENCE
    steps = step * np.eye(n)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    both = [top + steps[i] + steps[j] for i, j in pairs] + [top - steps[i] - steps[j] for i, j in pairs]
    heights = np.maximum(target(np.vstack([top[None], top + steps, top - steps, *both])), _BAD)
    middle, up, down = heights[0], heights[1 : n + 1], heights[n + 1 : 2 * n + 1]
    sides = up + down - 2.0 * middle
    hessian = np.diag(-sides / step**2)
    more = heights[2 * n + 1 :].reshape(2, -1).sum(axis=0)
    for (i, j), together in zip(pairs, more, strict=True):
        hessian[i, j] = hessian[j, i] = -(together - 2.0 * middle - sides[i] - sides[j]) / (2.0 * step**2)
    return curvatures(hessian)[1]
