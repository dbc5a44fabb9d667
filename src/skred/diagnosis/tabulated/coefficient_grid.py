"""A grid of added strengths that covers their posterior: looked for, with fits at all of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.parallel.threads import in_parts, side_by_side
from skred.physics.mechanisms.spec import Added

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
_LOOKING = {1: 11, 2: 6}
"""Strengths along each axis while the posterior is looked for, by the number of axes."""
_FINAL = {1: 13, 2: 8}
"""Strengths along each axis of the tables, between which cubic polynomials go."""
_COVERED_NATS = 11.0
"""How far below its maximum the density of strengths still counts: 4.7 standard deviations."""
_ENDS_NATS = 8.0
"""How far below the maximum the edge of a grid must be to be the end: four standard deviations."""
_STARTING_REACH = 5.0
"""Standard deviations, by the comparison, that the first grid reaches from the mean."""
_MOST_SCALES = 4.5
"""Scales of its prior that a strength reaches at most: beyond are seven in a million."""
_LOOKS = 6
"""Grids tried at most, which bounds the time."""
_SETTLED = 0.12
"""Shift of a grid's corners, in its widths, below which it has arrived: a step of the tables or so."""
_BEYOND = 0.25
"""By which share of its width a grid goes on beyond an edge where there is still something."""
_FARTHEST = 7.0
"""Standard deviations from the mean at which it ends in any case."""
_DEEP = 60.0
"""Nats below the maximum from which on densities count as equally small: a spline through them is smooth."""
_FINE = {1: 601, 2: 121}
"""Points along each axis at which the interpolated density is summed."""


class Grid(NamedTuple):
    """Regular grid of the added strengths, skewed where two go together.

    Attributes
    ----------
    origin : (n_added,) array
        Strengths of the first table.
    steps : (n_added, n_added) array
        Lower triangular: each column is the step from table to table along an axis.
    size : (n_added,) integer array
        Tables along each axis.
    """

    origin: FloatArray
    steps: FloatArray
    size: IntArray

    @property
    def points(self) -> FloatArray:
        """All strengths, the last axis running fastest, (n_tables, n_added)."""
        axes = [np.arange(n, dtype=float) for n in self.size]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return self.strengths(places)

    @property
    def least(self) -> FloatArray:
        """Smallest of each strength, (n_added,)."""
        return self.points.min(axis=0)

    @property
    def most(self) -> FloatArray:
        """Largest of each strength, (n_added,)."""
        return self.points.max(axis=0)

    def strengths(self, places: FloatArray) -> FloatArray:
        """Strengths at places in steps from the first table, (n, n_added) both."""
        return self.origin + places @ self.steps.T

    def places(self, strengths: FloatArray) -> FloatArray:
        """Places on the grid in steps from the first table, at its edge at most."""
        places = np.linalg.solve(self.steps, (strengths - self.origin).T).T
        return np.clip(places, 0.0, self.size - 1.0)

    def table(self, index: IntArray) -> IntArray:
        """Numbers of tables from places on the grid, (n, n_added) to (n,)."""
        result: IntArray = np.ravel_multi_index(tuple(index.T), tuple(self.size)).astype(np.int64)
        return result

    def nearest(self, strengths: FloatArray) -> IntArray:
        """Number of the nearest table, (n, n_added) to (n,)."""
        return self.table(np.rint(self.places(strengths)).astype(np.int64))

    def around(self, strengths: FloatArray) -> tuple[IntArray, FloatArray]:
        """Tables at the corners of a cell of the grid, and their linear weights, (n, 2^n_added)."""
        place = self.places(strengths)
        low = np.minimum(np.floor(place).astype(np.int64), self.size - 2)
        tables, weights = [], []
        for corner in range(2 ** len(self.size)):
            side = (corner >> np.arange(len(self.size))) & 1
            tables.append(self.table(low + side))
            weights.append(np.where(side == 1, place - low, 1.0 - place + low).prod(axis=1))
        return np.stack(tables, axis=1), np.stack(weights, axis=1)


class Located(NamedTuple):
    """Fits on a grid that covers the posterior of the added strengths, with their mean and its factor.

    Attributes
    ----------
    held : bool
        Whether all fits have one population, because avalanches differ in what is added.
    """

    grid: Grid
    fits: list[Fit]
    mean: FloatArray
    factor: FloatArray
    held: bool = False

    def populations_near(self, added: FloatArray, rng: np.random.Generator, wider: float = 1.0) -> FloatArray:
        """Draw the population's coordinates at each of some added strengths.

        Parameters
        ----------
        added : (n, n_added) array
        wider : float
            What its standard deviations are multiplied by.
        """
        found = [self.fits[table].found for table in self.grid.nearest(added)]
        return np.array([rng.multivariate_normal(one.psi, wider**2 * one.covariance) for one in found])


def locate(base: Base, extension: Extension, curves: Sequence[Curve]) -> Located:
    """Look for the added strengths where their curves had them, and around, until the range is settled."""
    n_axes, n_base = len(curves), len(base.law.mechanisms)
    scale = np.array([_prior(curve).scale_of(curve.shape) for curve in curves])
    either_sign = np.array([_prior(curve).either_sign for curve in curves])
    lowest = np.where(either_sign, -_MOST_SCALES * scale, 0.0)
    support = Support(lowest, _MOST_SCALES * scale)
    mean, sd = (np.array(values) for values in zip(*(curve.moments for curve in curves), strict=True))
    factor = np.diag(np.clip(sd, 0.01 * scale, scale))
    reach = np.full(n_axes, _STARTING_REACH)
    start = (base.population, base.fit.points)
    if n_axes == 1:
        start = _nearest_fit(curves[0], float(mean[0]), n_base)
    near: list[Fit] | None = None
    grid = _grid(mean, factor, -reach, reach, support, _LOOKING[n_axes])
    for look in range(_LOOKS):
        last = look == _LOOKS - 1
        fits = _fitted(base, extension, grid.points, start, near)
        heights = _heights(fits, grid.points / scale)
        best = int(heights.argmax())
        start = fits[best].found.population(n_base), fits[best].points
        mean, factor, low, high = _posterior(grid, heights, support)
        new = _grid(mean, factor, low, high, support, _FINAL[n_axes])
        settled = _moved(grid, new) < _SETTLED
        if settled and len(grid.points) >= len(new.points):
            break
        refined = settled or last or look == _LOOKS - 2
        before, fits = grid, _without_failures(fits, fits[best])
        grid = new if refined else _grid(mean, factor, low, high, support, _LOOKING[n_axes])
        near = [fits[k] for k in before.nearest(grid.points)]
    else:
        fits = _fitted(base, extension, grid.points, start, near)
    return Located(grid, _without_failures(fits, fits[best]), mean, factor)


def finer(base: Base, extension: Extension, located: Located) -> Located:
    """The same with half the steps between strengths."""
    old = located.grid
    grid = Grid(old.origin, 0.5 * old.steps, 2 * old.size - 1)
    near = [located.fits[k] for k in old.nearest(grid.points)]
    fits = _fitted(base, extension, grid.points, (base.population, base.fit.points), near)
    kept = [_without_failures([one], before) for one, before in zip(fits, near, strict=True)]
    return located._replace(grid=grid, fits=[one for (one,) in kept])


class Support(NamedTuple):
    """Where strengths may be, (n_added,) each."""

    low: FloatArray
    high: FloatArray


def _fitted(
    base: Base,
    extension: Extension,
    added: FloatArray,
    start: tuple[Population, FloatArray],
    near: Sequence[Fit] | None,
) -> list[Fit]:
    """Fits at strengths of what is added, (n, n_added); begun at fits nearby, one for each, if given."""
    given = np.column_stack([np.tile(base.strengths, (len(added), 1)), added])

    def fitted(part: slice) -> list[Fit]:
        if near is None:
            return refit(extension, base.rows, given[part], start)
        return refit(extension, base.rows, given[part], start, Rounds(least=1), near[part])

    return [fit for found in side_by_side(fitted, in_parts(len(added))) for fit in found]


def _heights(fits: Sequence[Fit], in_scales: FloatArray) -> FloatArray:
    """Log posterior densities of strengths, (n, n_added) in scales of their priors, not normalised."""
    heights = np.array([fit.found.log_evidence for fit in fits]) - 0.5 * np.sum(in_scales**2, axis=1)
    return np.nan_to_num(heights, nan=-np.inf, posinf=-np.inf)


def _moved(old: Grid, new: Grid) -> float:
    """How far the new grid's corners are from the old one's, in widths of the new."""
    ends = np.stack(np.meshgrid(*([[0.0, 1.0]] * len(new.size)), indexing="ij"), axis=-1)
    ends = ends.reshape(-1, len(new.size))
    difference = old.strengths(ends * (old.size - 1)) - new.strengths(ends * (new.size - 1))
    in_steps = np.linalg.solve(new.steps, difference.T).T
    return float(np.abs(in_steps / (new.size - 1)).max())


def _prior(curve: Curve) -> Added:
    added = curve.mechanism.added
    assert added is not None
    return added


def _nearest_fit(curve: Curve, strength: float, n_base: int) -> tuple[Population, FloatArray]:
    fit = curve.nearest(strength)
    return fit.found.population(n_base), fit.points


def _grid(
    mean: FloatArray, factor: FloatArray, low: FloatArray, high: FloatArray, support: Support, size: int
) -> Grid:
    """A grid from `low` to `high`, in units of the factor's columns from the mean, inside the support.

    A second strength that goes with the first can leave the support; its prior does not.
    """
    low, high = low.copy(), high.copy()
    for axis in range(len(mean)):
        if not factor[axis, :axis].any():
            low[axis] = max(low[axis], (support.low[axis] - mean[axis]) / factor[axis, axis])
            high[axis] = min(high[axis], (support.high[axis] - mean[axis]) / factor[axis, axis])
    steps = factor * ((high - low) / (size - 1))
    origin = mean + factor @ low
    if len(mean) == 1 and low[0] * factor[0, 0] < -mean[0] < high[0] * factor[0, 0]:
        # Shifted so that 0, where there is the base law alone, is on it.
        n_below = math.ceil(-origin[0] / steps[0, 0] - 1e-6)
        origin = -n_below * steps[0]
        size += int(origin[0] + (size - 1) * steps[0, 0] < mean[0] + factor[0, 0] * high[0] * (1 - 1e-9))
    return Grid(origin, steps, np.full(len(mean), size, dtype=np.int64))


def _posterior(
    grid: Grid, heights: FloatArray, support: Support
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean and covariance's factor of strengths from log densities on a grid; the range that counts.

    The range is in units of the factor's columns from the mean; beyond an edge where there is still
    something it goes on.
    """
    n_axes = len(grid.size)
    table = np.maximum(heights - heights.max(), -_DEEP).reshape(grid.size)
    axes = [np.arange(n, dtype=float) for n in grid.size]
    between = RegularGridInterpolator(axes, table, method="cubic")
    fine = [np.linspace(0.0, n - 1.0, _FINE[n_axes]) for n in grid.size]
    places = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1).reshape(-1, n_axes)
    strengths, density = grid.strengths(places), between(places)
    slack = 1e-9 * (support.high - support.low)
    allowed = np.all((strengths >= support.low - slack) & (strengths <= support.high + slack), axis=1)
    density = np.where(allowed, density, -np.inf)
    weights = np.exp(density - density.max())
    weights /= weights.sum()
    mean = weights @ strengths
    deviation = strengths - mean
    covariance = np.einsum("k,ki,kj->ij", weights, deviation, deviation)
    factor = np.linalg.cholesky(covariance + 1e-6 * np.diag(np.diag(covariance)))
    covered = density > density.max() - _COVERED_NATS
    white = np.linalg.solve(factor, deviation[covered].T).T
    low, high = white.min(axis=0), white.max(axis=0)
    for axis in range(n_axes):
        for edge in (0.0, grid.size[axis] - 1.0):
            if density[places[:, axis] == edge].max() > density.max() - _ENDS_NATS:
                width = _BEYOND * (high - low)
                at_edge = white[places[covered, axis] == edge].mean(axis=0)
                low = np.where(at_edge < 0.0, low - width, low)
                high = np.where(at_edge > 0.0, high + width, high)
    return mean, factor, np.maximum(low, -_FARTHEST), np.minimum(high, _FARTHEST)


def _without_failures(fits: Sequence[Fit], instead: Fit) -> list[Fit]:
    """Fits, those that came to nothing replaced by another."""
    return [
        fit if np.isfinite(fit.found.psi).all() and np.isfinite(fit.found.covariance).all() else instead
        for fit in fits
    ]
