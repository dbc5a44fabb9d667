"""Draws of an avalanche's own strengths and release, to be weighed by some of its readings or by others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    event_modes,
    log_joint,
)
from skred.diagnosis.predict.draws import Draws
from skred.inference.reading_density import log_likelihoods

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
_DEGREES = 6.0
"""Of the Student t around where readings put an avalanche."""
_NEAR = (0.3, 0.05)
"""Widths around points that an earlier sample missed, in the population's."""
_CENTRES = 6
"""Sets of readings that points are drawn around, at most."""
_LEAST_SCALE = 1e-6
"""Of a covariance, relative to its diagonal: what a factorisation needs."""


class Sizes(NamedTuple):
    """Points for each draw of the population.

    Attributes
    ----------
    of_population : int
        From it.
    around_each : int
        Around where each set of readings puts the avalanche, at each width.
    widths : tuple of float
        As many times the standard deviations of the linear model.
    """

    of_population: int
    around_each: int
    widths: tuple[float, ...]


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

    def missed(self, enough: float) -> FloatArray:
        """The likeliest point of each set of readings that too few draws count for, (n, n_base + 1)."""
        sets = [k for k in range(len(self.log_weights)) if self.effective(k) < enough]
        found: FloatArray = self.points[self.log_weights[sets].argmax(axis=1)]
        return found


class _Parts(NamedTuple):
    """Student t densities for each draw of the population: (n_draws, n_centres, ...)."""

    centres: FloatArray
    factors: FloatArray

    def at_widths(self, widths: tuple[float, ...]) -> _Parts:
        """The same at several widths."""
        factors = [width * self.factors for width in widths]
        return _Parts(np.tile(self.centres, (1, len(widths), 1)), np.concatenate(factors, axis=1))

    def with_more(self, more: _Parts) -> _Parts:
        """These and others."""
        return _Parts(*(np.concatenate(both, axis=1) for both in zip(self, more, strict=True)))


def sample(
    likelihood: EventLikelihood, draws: Draws, sizes: Sizes, near: FloatArray, rng: np.random.Generator
) -> Sample:
    """Draw one avalanche, and weigh the draws by sets of its readings.

    Parameters
    ----------
    likelihood : EventLikelihood
        Its rows are sets of readings of one avalanche, the empty one first; at the mean of the strengths.
    draws : Draws
        By the other avalanches.
    near : (n_near, n_base + 1) array
        Further points to draw around: those that an earlier sample missed, see `Sample.missed`.
    """
    n, n_base = draws.means.shape
    normal = rng.standard_normal((n, sizes.of_population, n_base + 1))
    logs = draws.means[:, None] + normal[..., :-1] @ draws.factors.transpose(0, 2, 1)
    wide = np.concatenate([logs, normal[..., -1:]], axis=2)
    chosen = _centres(likelihood)
    if len(chosen):
        typical = _typical(draws)
        modes = _modes(likelihood.take(chosen), typical, wide)
        parts = _parts(modes, likelihood.strengths, draws).at_widths(sizes.widths)
        parts = parts.with_more(_around(near, typical, n).at_widths(_NEAR))
        points = np.concatenate([wide, _drawn(parts, sizes.around_each, rng)], axis=1)
        log_prior = _log_population(points, draws)
        shares = np.array([sizes.of_population] + [sizes.around_each] * parts.centres.shape[1], dtype=float)
        every = np.concatenate([log_prior[..., None], _log_t(points, parts)], axis=2)
        log_proposal = np.logaddexp.reduce(every + np.log(shares / shares.sum()), axis=2)
        log_ratio = (log_prior - log_proposal).ravel()
    else:
        points, log_ratio = wide, np.zeros(wide.shape[0] * wide.shape[1])
    each = points.shape[1]
    flat, strengths = points.reshape(n * each, -1), draws.strengths.repeat(each, axis=0)
    event = likelihood.rows.event[0]
    fronts = likelihood.extension.predict(np.full(len(flat), event), flat, strengths)
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


def _typical(draws: Draws) -> Population:
    """One population for all draws."""
    covariance = np.einsum("nij,nkj->ik", draws.factors, draws.factors) / len(draws.factors)
    covariance += np.atleast_2d(np.cov(draws.means.T, bias=True))
    return Population(draws.means.mean(axis=0)[None], covariance[None])


def _around(near: FloatArray, typical: Population, n_draws: int) -> _Parts:
    """Points to draw around, as wide as the population and the same for all its draws."""
    n_axes = typical.mean.shape[1] + 1
    factor = np.eye(n_axes)
    factor[:-1, :-1] = np.linalg.cholesky(typical.covariance[0])
    shape = n_draws, len(near), n_axes
    return _Parts(np.broadcast_to(near, shape), np.broadcast_to(factor, (*shape, n_axes)))


def _modes(likelihood: EventLikelihood, population: Population, tried: FloatArray) -> Modes:
    """Where each set of readings puts the avalanche, for a typical population."""
    flat, n_rows = tried.reshape(-1, tried.shape[2]), len(likelihood.rows.event)
    many = likelihood.take(np.repeat(np.arange(n_rows), len(flat)))
    heights = log_joint(many, np.tile(flat, (n_rows, 1)), population).reshape(n_rows, -1)
    return event_modes(likelihood, flat[heights.argmax(axis=1)], population)


def _parts(modes: Modes, strengths: FloatArray, draws: Draws) -> _Parts:
    """Where the readings put the avalanche by each draw: the linear model around each mode."""
    n_draws, n_base = draws.means.shape
    at, information = modes.tangents_at, modes.information
    precision = Population(draws.means, draws.factors @ draws.factors.transpose(0, 2, 1)).precision
    off = np.zeros((n_draws, len(at), n_base + 1))
    off[..., :-1] = draws.means[:, None]
    off -= at
    pull = np.einsum("nij,ncj->nci", precision, off)
    slope = np.einsum("ci,cij->cj", modes.slope, modes.by_points)
    crossed = modes.by_points.transpose(0, 2, 1) @ modes.weighed(modes.by_strengths)
    pull += slope - np.einsum("cij,nj->nci", crossed, draws.strengths - strengths)
    total = information + precision[:, None]
    covariance = np.linalg.inv(total)
    centres = at + np.einsum("ncij,ncj->nci", covariance, pull)
    covariance = 0.5 * (covariance + covariance.swapaxes(2, 3))
    diagonal = np.einsum("ncii->nci", covariance)
    diagonal *= 1.0 + _LEAST_SCALE
    return _Parts(centres, np.linalg.cholesky(covariance))


def _drawn(parts: _Parts, each: int, rng: np.random.Generator) -> FloatArray:
    """Points around the centres, (n_draws, n_centres * each, n_axes)."""
    n, n_centres, n_axes = parts.centres.shape
    normal = rng.standard_normal((n, n_centres, each, n_axes))
    normal /= np.sqrt(rng.chisquare(_DEGREES, (n, n_centres, each)) / _DEGREES)[..., None]
    points = parts.centres[:, :, None] + normal @ parts.factors.swapaxes(2, 3)
    return points.reshape(n, n_centres * each, n_axes)


def _log_t(points: FloatArray, parts: _Parts) -> FloatArray:
    """Log density of points around each centre, (n_draws, n_points, n_centres)."""
    n_axes = points.shape[2]
    whiten = np.linalg.inv(parts.factors)
    off = points[:, :, None] - parts.centres[:, None]
    squares = (np.einsum("ncij,npcj->npci", whiten, off) ** 2).sum(axis=3)
    constant = gammaln(0.5 * (_DEGREES + n_axes)) - gammaln(0.5 * _DEGREES)
    constant -= 0.5 * n_axes * np.log(_DEGREES * np.pi)
    scale = np.log(np.einsum("ncii->nci", parts.factors)).sum(axis=2)
    found: FloatArray = constant - scale[:, None] - 0.5 * (_DEGREES + n_axes) * np.log1p(squares / _DEGREES)
    return found


def _log_population(points: FloatArray, draws: Draws) -> FloatArray:
    """Log density of points by the draw of the population that each is of, (n_draws, n_points)."""
    off = points[..., :-1] - draws.means[:, None]
    white = np.einsum("nij,npj->npi", np.linalg.inv(draws.factors), off)
    scale = np.log(np.einsum("nii->ni", draws.factors)).sum(axis=1)
    squares = (white**2).sum(axis=2) + points[..., -1] ** 2
    found: FloatArray = -0.5 * squares - scale[:, None] - 0.5 * points.shape[2] * np.log(2.0 * np.pi)
    return found
