"""Draws of an avalanche's own strengths and release, to be weighed by some of its readings or by others."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.evidence.adaptive_sampling import log_student, student
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Modes, Population
from skred.diagnosis.evidence.tolerance import STANDARD_ERROR
from skred.diagnosis.predict.draws import Draws, modes_near
from skred.inference.metropolis_chain import DEGREES_OF_FREEDOM
from skred.inference.reading_density import log_likelihoods

_CENTRES = 6
"""Sets of readings that points are drawn around, at most: the time goes with their square."""


class Sample(NamedTuple):
    """Draws of one avalanche.

    Attributes
    ----------
    points : (n, n_base + 1) array
        Logarithms of its strengths, and its release's deviation.
    fronts : (n, n_sensors + 1) array
        Their readings without errors, the runout last.
    log_weights : (n_sets, n) array
        Of each, given each set of readings; their mean is the probability density of the set.
    """

    points: FloatArray
    fronts: FloatArray
    log_weights: FloatArray

    def effective(self, which: int) -> float:
        """Effective number of draws, given a set of readings."""
        weights = np.exp(self.log_weights[which] - self.log_weights[which].max())
        return float(weights.sum() ** 2 / np.sum(weights**2))

    def missed(self) -> FloatArray:
        """The likeliest point of each set of readings that too few draws count for, (n, n_base + 1)."""
        sets = [k for k in range(len(self.log_weights)) if too_few(self.effective(k))]
        found: FloatArray = self.points[self.log_weights[sets].argmax(axis=1)]
        return found


def too_few(effective: Any) -> Any:
    """Whether the logarithm of the mean of so many effective draws is less well known than evidence is."""
    return effective**-0.5 > STANDARD_ERROR


class _Parts(NamedTuple):
    """Student t densities for each draw of the population, (n_draws, n_centres, ...); triangular factors."""

    centres: FloatArray
    factors: FloatArray

    def with_more(self, more: _Parts) -> _Parts:
        """These and others."""
        return _Parts(*(np.concatenate(both, axis=1) for both in zip(self, more, strict=True)))


def sample(
    likelihood: EventLikelihood, draws: Draws, each: int, near: FloatArray, rng: np.random.Generator
) -> Sample:
    """Draw one avalanche, and weigh the draws by sets of its readings.

    Parameters
    ----------
    likelihood : EventLikelihood
        Its rows are sets of readings of one avalanche, the empty one first; at the mean of the strengths.
    draws : Draws
        By the other avalanches.
    each : int
        Points around each centre for each draw of the population, and twice as many from it.
    near : (n_near, n_base + 1) array
        Further points to draw around: those that an earlier sample missed, see `Sample.missed`.
    """
    points = wide = draws.points(2 * each, rng)
    log_prior = log_proposal = _log_population(wide, draws)
    chosen = _centres(likelihood)
    if len(chosen):
        typical = draws.typical
        modes = modes_near(likelihood.take(chosen), typical, wide)
        parts = _parts(modes, likelihood.strengths, draws).with_more(_around(near, typical, len(wide)))
        points = np.concatenate([wide, _drawn(parts, each, rng)], axis=1)
        log_prior = _log_population(points, draws)
        shares = np.array([2.0] + [1.0] * parts.centres.shape[1])
        every = np.concatenate([log_prior[..., None], _log_t(points, parts)], axis=2)
        log_proposal = np.logaddexp.reduce(every + np.log(shares / shares.sum()), axis=2)
    flat, strengths = points.reshape(-1, points.shape[2]), draws.strengths.repeat(points.shape[1], axis=0)
    event = likelihood.rows.event[0]
    fronts = likelihood.extension.predict(np.full(len(flat), event), flat, strengths)
    log_ratio = (log_prior - log_proposal).ravel()
    return Sample(flat, fronts, log_ratio + _log_likelihoods(likelihood, fronts))


def _log_likelihoods(likelihood: EventLikelihood, fronts: FloatArray) -> FloatArray:
    """Of every set of readings given every front, (n_sets, n); 0 of the empty one."""
    rows = likelihood.rows
    found = [
        log_likelihoods(np.full(len(fronts), row), fronts, rows.readings, rows.errors)
        for row in range(len(rows.event))
    ]
    return np.array(found)


def _centres(likelihood: EventLikelihood) -> IntArray:
    """Sets of readings that points are drawn around: all but the empty one, or some from few to many."""
    sizes = likelihood.rows.readings.observed.sum(axis=1)
    order = np.argsort(sizes, kind="stable")
    order = order[sizes[order] > 0]
    if len(order) <= _CENTRES:
        return order
    return order[np.linspace(0, len(order) - 1, _CENTRES).round().astype(int)]


def _around(near: FloatArray, typical: Population, n_draws: int) -> _Parts:
    """Points to draw around, as wide as the population and the same for all its draws."""
    n_axes = typical.mean.shape[1] + 1
    factor = np.eye(n_axes)
    factor[:-1, :-1] = np.linalg.cholesky(typical.covariance[0])
    shape = n_draws, len(near), n_axes
    return _Parts(np.broadcast_to(near, shape), np.broadcast_to(factor, (*shape, n_axes)))


def _parts(modes: Modes, strengths: FloatArray, draws: Draws) -> _Parts:
    """Where the readings put the avalanche by each draw: the linear model around each mode."""
    n_draws, n_base = draws.means.shape
    at, information = modes.tangents_at, modes.information
    precision = Population(draws.means, draws.covariances).precision
    off = np.zeros((n_draws, len(at), n_base + 1))
    off[..., :-1] = draws.means[:, None]
    off -= at
    pull = np.einsum("nij,ncj->nci", precision, off)
    slope = np.einsum("ci,cij->cj", modes.slope, modes.by_points)
    crossed = modes.by_points.transpose(0, 2, 1) @ modes.weighed(modes.by_strengths)
    pull += slope - np.einsum("cij,nj->nci", crossed, draws.strengths - strengths)
    # Of the precision, not of its inverse: that need not be positive as it is rounded.
    factors = np.linalg.inv(np.linalg.cholesky(information + precision[:, None])).swapaxes(2, 3)
    return _Parts(at + np.einsum("ncij,nckj,nck->nci", factors, factors, pull), factors)


def _drawn(parts: _Parts, each: int, rng: np.random.Generator) -> FloatArray:
    """Points around the centres, (n_draws, n_centres * each, n_axes)."""
    n, n_centres, n_axes = parts.centres.shape
    white = student((n, n_centres, each, n_axes), DEGREES_OF_FREEDOM, rng)
    points = parts.centres[:, :, None] + white @ parts.factors.swapaxes(2, 3)
    return points.reshape(n, n_centres * each, n_axes)


def _log_t(points: FloatArray, parts: _Parts) -> FloatArray:
    """Log density of points around each centre, (n_draws, n_points, n_centres)."""
    whiten = np.linalg.inv(parts.factors)
    off = points[:, :, None] - parts.centres[:, None]
    squares = (np.einsum("ncij,npcj->npci", whiten, off) ** 2).sum(axis=3)
    scale = np.log(np.einsum("ncii->nci", parts.factors)).sum(axis=2)
    return log_student(squares, points.shape[2], DEGREES_OF_FREEDOM, scale[:, None])


def _log_population(points: FloatArray, draws: Draws) -> FloatArray:
    """Log density of points by the draw of the population that each is of, (n_draws, n_points)."""
    off = points[..., :-1] - draws.means[:, None]
    white = np.einsum("nij,npj->npi", np.linalg.inv(draws.factors), off)
    scale = np.log(np.einsum("nii->ni", draws.factors)).sum(axis=1)
    squares = (white**2).sum(axis=2) + points[..., -1] ** 2
    found: FloatArray = -0.5 * squares - scale[:, None] - 0.5 * points.shape[2] * np.log(2.0 * np.pi)
    return found
