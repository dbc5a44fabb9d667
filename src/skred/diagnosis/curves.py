"""The evidence along the strength of an added mechanism: everything else refitted at each value.

No derivative by the strength is taken at the null: a strong effect may hide there, behind base strengths
and scatter that absorb it, and show only when it is let in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from skred.diagnosis.event_nodes import USUAL, Budget, event_nodes
from skred.diagnosis.extension import Extension, extended, setting_of
from skred.diagnosis.marginal import Evidence, coordinates, evidence, prior_log_scale
from skred.diagnosis.mixed import mean_prior
from skred.diagnosis.modes import Population, Rows, campaign_rows, event_modes, take_rows
from skred.inference.hierarchical import HierarchicalProblem
from skred.inference.surface import Nodes
from skred.physics.law import Law
from skred.physics.mechanisms.spec import Direction, Mechanism, Setting, Shape

FloatArray = NDArray[np.float64]
_GRID = (0.15, 0.4, 0.8, 1.4, 2.3, 3.5)
"""Strengths at first, in scales of the prior."""
_ROUNDS = 2
_FINE = 401
"""Points at which a curve is integrated."""
_DEEP = 40.0


class Fit(NamedTuple):
    """A law, perhaps extended, fitted at fixed strengths of what is added.

    Attributes
    ----------
    found : Evidence
    points : (n_events, n_base + 1) array
        The events' modes.
    """

    found: Evidence
    points: FloatArray


@dataclass(frozen=True, eq=False)
class Base:
    """The law that mechanisms are added to, fitted.

    Attributes
    ----------
    problem : HierarchicalProblem
    law : Law
    setting : Setting
    rows : Rows
    fit : Fit
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

    @property
    def log_scale(self) -> FloatArray:
        """Logarithm of the scales of the medians' priors."""
        return prior_log_scale(mean_prior(self.law))

    @property
    def population(self) -> Population:
        """The most probable population."""
        return self.fit.found.population(len(self.law.mechanisms))


def refit(
    extension: Extension,
    rows: Rows,
    strengths: FloatArray,
    start: tuple[Population, FloatArray],
    log_scale: FloatArray,
    budget: Budget = USUAL,
    n_rounds: int = _ROUNDS,
) -> list[Fit]:
    """Refit population and events at some strengths, one group of rows each.

    Parameters
    ----------
    rows : Rows
        The campaign's rows.
    strengths : (n_groups, n_directions) array
    start : (Population, (n_events, n_base + 1) array)
        Of one group.
    """
    n_groups, n_events = len(strengths), len(rows.event)
    many = _repeated(rows, n_groups)
    given = np.repeat(strengths, n_events, axis=0)
    population = Population(
        np.repeat(start[0].mean, n_groups, axis=0), np.repeat(start[0].covariance, n_groups, axis=0)
    )
    points = np.tile(start[1], (n_groups, 1))
    n = population.mean.shape[1]
    psi = [coordinates(population, k) for k in range(n_groups)]
    found: list[Evidence] = []
    for _ in range(n_rounds):
        modes = event_modes(extension, many, points, given, population, n_steps=8)
        points = modes.points
        nodes = event_nodes(extension, many, given, population, modes, budget)
        found = [
            evidence(part, log_scale, start_psi)
            for part, start_psi in zip(_split(nodes, n_groups, n_events), psi, strict=True)
        ]
        psi = [one.psi for one in found]
        parts = [one.population(n) for one in found]
        population = Population(
            np.concatenate([part.mean for part in parts]), np.concatenate([part.covariance for part in parts])
        )
    return [Fit(one, points[k * n_events : (k + 1) * n_events].copy()) for k, one in enumerate(found)]


def _repeated(rows: Rows, n_groups: int) -> Rows:
    """The same rows for each of several groups."""
    n = len(rows.event)
    group_rows = np.tile(np.arange(n), n_groups)
    repeated = take_rows(rows.readings, group_rows)
    group = np.repeat(np.arange(n_groups), n)
    return Rows(np.tile(rows.event, n_groups), group, repeated, rows.errors)


def _split(nodes: Nodes, n_groups: int, n_events: int) -> list[Nodes]:
    """Nodes of each group."""
    parts = []
    for k in range(n_groups):
        first = nodes.first[k * n_events : (k + 1) * n_events + 1]
        inside = slice(first[0], first[-1])
        points = np.ascontiguousarray(nodes.points[:, inside])
        parts.append(Nodes(first - first[0], points, nodes.log_weights[inside]))
    return parts


@dataclass(frozen=True, eq=False)
class Curve:
    """Evidence along the strength of one mechanism of one shape.

    Attributes
    ----------
    mechanism : Mechanism
    shape : Shape
    direction : Direction
    strengths : (n,) array
        In the strength's unit, increasing, 0 among them.
    log_evidence : (n,) array
        Relative to strength 0.
    fits : tuple of Fit
        One for each strength.
    """

    mechanism: Mechanism
    shape: Shape
    direction: Direction
    strengths: FloatArray
    log_evidence: FloatArray
    fits: tuple[Fit, ...]

    def fine(self, scale: float | None = None) -> tuple[FloatArray, FloatArray]:
        """Strengths on a fine grid, and the log posterior density there, not normalised."""
        added = self.mechanism.added
        assert added is not None
        scale = added.scale if scale is None else scale
        strengths = np.linspace(self.strengths[0], self.strengths[-1], _FINE)
        floor = self.log_evidence.max() - _DEEP
        spline = CubicSpline(self.strengths, np.maximum(self.log_evidence, floor))
        log_prior = -0.5 * (strengths / scale) ** 2 - 0.5 * math.log(2.0 * math.pi * scale**2)
        if not added.either_sign:
            log_prior = log_prior + math.log(2.0)
        return strengths, spline(strengths) + log_prior

    def log_bayes_factor(self, scale: float | None = None) -> float:
        """Against strength 0, in nats; with the prior of another scale if one is given."""
        strengths, log_density = self.fine(scale)
        most = float(log_density.max())
        return most + math.log(float(np.trapezoid(np.exp(log_density - most), strengths)))

    def moments(self) -> tuple[float, float]:
        """Posterior mean and standard deviation of the strength, if the mechanism is there."""
        strengths, log_density = self.fine()
        weights = np.exp(log_density - log_density.max())
        weights /= weights.sum()
        mean = float(weights @ strengths)
        return mean, math.sqrt(max(float(weights @ (strengths - mean) ** 2), 0.0))


def curve(base: Base, mechanism: Mechanism, shape: Shape, *, refine: int = 0) -> Curve:
    """Evidence along the strength of a mechanism, on a grid, with `refine` rounds of points near the top."""
    added = mechanism.added
    assert added is not None
    direction = added.direction(base.setting, shape)
    extension = extended(base.problem, base.law, (*base.directions, direction))
    grid = added.scale * np.array(_GRID)
    strengths = np.concatenate([-grid[::-1], grid]) if added.either_sign else grid
    fits = dict(zip(strengths, _at(base, extension, strengths), strict=True))
    fits[0.0] = base.fit
    for _ in range(refine):
        rough = _curve(base, mechanism, shape, direction, fits)
        mean, sd = rough.moments()
        new = np.array([mean - sd, mean + sd])
        if not added.either_sign:
            new = np.maximum(new, 0.02 * added.scale)
        new = np.array([x for x in new if min(abs(x - y) for y in fits) > 0.02 * added.scale])
        if len(new):
            fits |= dict(zip(new, _at(base, extension, new), strict=True))
    return _curve(base, mechanism, shape, direction, fits)


def _at(base: Base, extension: Extension, strengths: FloatArray) -> list[Fit]:
    given = np.column_stack([np.tile(base.strengths, (len(strengths), 1)), strengths])
    start = (base.population, base.fit.points)
    return refit(extension, base.rows, given, start, base.log_scale)


def _curve(
    base: Base, mechanism: Mechanism, shape: Shape, direction: Direction, fits: dict[float, Fit]
) -> Curve:
    strengths = np.array(sorted(fits))
    ordered = tuple(fits[x] for x in strengths)
    heights = np.array([fit.found.log_evidence for fit in ordered]) - base.fit.found.log_evidence
    heights = np.nan_to_num(heights, nan=-1e3, neginf=-1e3)
    return Curve(mechanism, shape, direction, strengths, heights, ordered)


def fit_base(
    problem: HierarchicalProblem, law: Law, population: Population, points: FloatArray | None = None
) -> Base:
    """The base law fitted, from roughly where its population is."""
    extension = extended(problem, law)
    setting, rows = setting_of(problem, law), campaign_rows(extension)
    if points is None:
        points = np.zeros((len(rows.event), len(law.mechanisms) + 1))
        points[:, :-1] = population.mean[0]
    log_scale = prior_log_scale(mean_prior(law))
    fit = refit(extension, rows, np.empty((1, 0)), (population, points), log_scale, n_rounds=4)[0]
    return Base(problem, law, setting, rows, fit)
