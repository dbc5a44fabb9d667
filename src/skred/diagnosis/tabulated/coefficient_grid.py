"""A grid of added strengths that covers their posterior, with fits at all of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.marginal import Evidence
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.evidence.tolerance import MOST_ROUNDS
from skred.parallel.threads import in_parts, side_by_side

TABLES = {1: 13, 2: 8}
"""Strengths along each axis of the tables, between which cubic polynomials go, by the number of axes."""
_REACH = 5.0
"""Standard deviations that a grid reaches from the mean at first."""
_ENDS_NATS = 8.0
"""How far below the maximum the edge of a grid must be to be the end: four standard deviations."""
_FARTHEST = 32.0
"""How many times what all may have in common an avalanche may have where they differ in it: one of thirty has
so much more than all."""
_BEYOND = 2.0
"""How many times as far as any avalanche is such tables reach."""
_FIRST_STEP, _BEND = 1.0 / 12.0, 1.0 / 16.0
"""The first step of such tables, in what all may have in common; and the last ones, in the strength there."""


class Grid(NamedTuple):
    """Grid of the added strengths, skewed where two go together: regular, or with steps that grow with them.

    Attributes
    ----------
    origin : (n_added,) array
        Strengths of the first table.
    steps : (n_added, n_added) array
        Lower triangular: each column is the step from table to table along an axis.
    bends : (n_added,) array
        0 for equal steps along an axis; else steps grow with the hyperbolic sine of the way from the origin,
        this is its scale, and far away they are so large a share of it.
    size : (n_added,) integer array
        Tables along each axis.
    """

    origin: FloatArray
    steps: FloatArray
    bends: FloatArray
    size: IntArray

    @property
    def points(self) -> FloatArray:
        """All strengths, the last axis running fastest, (n_tables, n_added)."""
        axes = [np.arange(n, dtype=float) for n in self.size]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return self.strengths(places)

    def strengths(self, places: FloatArray) -> FloatArray:
        """Strengths at places in tables from the first one, (n, n_added) both."""
        bends = np.where(self.bends == 0.0, 1.0, self.bends)
        ways = np.where(self.bends == 0.0, places, np.sinh(bends * places) / bends)
        return self.origin + ways @ self.steps.T

    def places(self, strengths: FloatArray) -> FloatArray:
        """Places on the grid in tables from the first one, at its edge at most."""
        ways = np.linalg.solve(self.steps, (strengths - self.origin).T).T
        bends = np.where(self.bends == 0.0, 1.0, self.bends)
        places = np.where(self.bends == 0.0, ways, np.arcsinh(bends * ways) / bends)
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
    """Fits on a grid of the added strengths, and the mean of their posterior and its factor."""

    grid: Grid
    fits: list[Fit]
    mean: FloatArray
    factor: FloatArray

    @property
    def centres(self) -> FloatArray:
        """Mean of the population at each strength, (n_tables, n_base)."""
        return np.stack([fit.population.mean[0] for fit in self.fits])

    @property
    def finer(self) -> Located:
        """With half the steps between strengths, and at each the population of the nearest."""
        grid = Grid(self.grid.origin, 0.5 * self.grid.steps, 0.5 * self.grid.bends, 2 * self.grid.size - 1)
        return self._replace(grid=grid, fits=[self.fits[k] for k in self.grid.nearest(grid.points)])

    def refitted(self, base: Base, extension: Extension) -> Located:
        """With a population for each strength itself."""
        return self._replace(fits=_fitted(base, extension, self.grid.points, self.fits))


def locate(base: Base, extension: Extension, curves: Sequence[Curve]) -> Located:
    """Put a grid where curves have the strengths, and move its ends until it covers their posterior.

    Raises
    ------
    numpy.linalg.LinAlgError
        If nothing is found at any strength.
    """
    scale, widest = (np.array(of) for of in zip(*((one.scale, one.widest) for one in curves), strict=True))
    low, slack = np.where([curve.added.either_sign for curve in curves], -np.inf, 0.0), 1e-9 * scale
    mean, sd = (np.array(values) for values in zip(*(curve.moments for curve in curves), strict=True))
    factor, ends = np.diag(np.clip(sd, 0.01 * scale, widest)), np.full(len(curves), _REACH)
    grid = _grid(mean, factor, (-ends, ends), low)
    near = [curves[-1].nearest(strength) for strength in grid.points[:, -1]]
    for look in range(MOST_ROUNDS):
        points = grid.points
        fits = _fitted(base, extension, points, near)
        density = np.array([fit.found.log_evidence for fit in fits])
        density += sum(curve.log_prior(points[:, k]) for k, curve in enumerate(curves))
        allowed = np.all(points >= low - slack, axis=1)
        density = np.where(allowed & np.isfinite(density), density, -np.inf)
        if density.max() == -np.inf:
            raise np.linalg.LinAlgError("nothing is found at any strength of the grid")
        counts = density > density.max() - _ENDS_NATS
        mean, factor = _moments(grid, density)
        at = np.stack(np.unravel_index(np.flatnonzero(counts), grid.size), axis=1)
        inside = points[counts] > low + slack
        below, above = (((at == edge) & inside).any(axis=0) for edge in (0, grid.size - 1))
        # The first grid is of what each curve says alone.
        if look > 0 and not (below | above).any():
            break
        white = np.linalg.solve(factor, (points[counts] - mean).T).T
        first, last = white.min(axis=0), white.max(axis=0)
        step = np.abs(np.linalg.solve(factor, grid.steps)).max(axis=1)
        # Where the posterior goes on beyond an end, half as far again; else one step beyond what counts.
        farther = np.maximum(0.5 * (last - first), step)
        reach = first - np.where(below, farther, step), last + np.where(above, farther, step)
        before, grid = grid, _grid(mean, factor, reach, low)
        near = [fits[k] for k in before.nearest(grid.points)]
    else:
        fits = _fitted(base, extension, grid.points, near)
    return Located(grid, fits, mean, factor)


def from_nothing(
    curve: Curve,
    found: Evidence,
    farthest: float | None = None,
    strength: tuple[float, float] | None = None,
) -> Located:
    """A grid of one strength from none at all to far beyond what all avalanches could have in common.

    Where avalanches differ in it, some have none and others many times as much: each knows its own to some
    percent at best.

    Parameters
    ----------
    found : Evidence
        Populations around all of it.
    farthest : float, optional
        The size of the largest that an avalanche has, where that is known.
    strength : (float, float), optional
        Its mean and standard deviation; those of the curve without.
    """
    common, common_sd = curve.moments
    in_common = abs(common) + common_sd
    step, end = _FIRST_STEP * in_common, _BEYOND * (farthest or _FARTHEST * in_common)
    last = max(math.ceil(math.asinh(_BEND * end / step) / _BEND), 3)
    steps = np.array([[math.copysign(step, common)]])
    grid = Grid(np.zeros(1), steps, np.array([_BEND]), np.array([last + 1]))
    fits = [Fit(found, curve.nearest(float(strength)).points) for strength in grid.points[:, 0]]
    mean, sd = strength or curve.moments
    return Located(grid, fits, np.array([mean]), np.array([[sd]]))


def _fitted(base: Base, extension: Extension, added: FloatArray, near: Sequence[Fit]) -> list[Fit]:
    """Fits at strengths of what is added, (n, n_added), begun at others.

    Where nothing is found these, without evidence: theirs is of another strength.
    """
    given = base.given(added)

    def fitted(part: slice) -> list[Fit]:
        return refit(extension, base.rows, given[part], base.fit.start, Rounds(least=1), near[part])

    fits = [fit for found in side_by_side(fitted, in_parts(len(added))) for fit in found]
    return [
        fit
        if np.isfinite(fit.found.psi).all() and np.isfinite(fit.found.covariance).all()
        else before._replace(found=before.found._replace(log_evidence=-np.inf))
        for fit, before in zip(fits, near, strict=True)
    ]


def _grid(
    mean: FloatArray, factor: FloatArray, reach: tuple[FloatArray, FloatArray], least: FloatArray
) -> Grid:
    """A grid that reaches so many of the factor's columns from the mean along each, from the least on.

    A second strength that goes with the first can be less than that; its prior is not.
    """
    size, (low, high) = TABLES[len(mean)], (side.copy() for side in reach)
    for axis in range(len(mean)):
        if not factor[axis, :axis].any():
            low[axis] = max(low[axis], (least[axis] - mean[axis]) / factor[axis, axis])
    steps = factor * ((high - low) / (size - 1))
    return Grid(mean + factor @ low, steps, np.zeros(len(mean)), np.full(len(mean), size, dtype=np.int64))


def _moments(grid: Grid, density: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance's factor of strengths from log densities on a grid, each for a cell around it."""
    weights = np.exp(density - density.max())
    weights /= weights.sum()
    mean = weights @ grid.points
    deviation = grid.points - mean
    covariance = np.einsum("k,ki,kj->ij", weights, deviation, deviation)
    return mean, np.linalg.cholesky(covariance + grid.steps @ grid.steps.T / 12.0)
