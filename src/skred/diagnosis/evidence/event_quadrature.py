"""Quadrature points of each event's likelihood over its own strengths, where a population makes them likely.

Points come from a mixture of proposals: many around the event's own mode, some over the whole population,
and many where those have found the weight to be. Each is weighed by the mixture's density. So a second mode
(reached, not reached) that the first proposal misses still counts. The same quasi-random numbers serve every
strength, which makes differences between strengths smoother than the integrals themselves. Where one
strength is all that is free, points lie on a line (`line_nodes`) and nothing is random.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Modes, Population, Rows
from skred.diagnosis.evidence.line_quadrature import line_nodes
from skred.inference.hierarchical.surface import Nodes
from skred.inference.reading_density import log_likelihoods
from skred.parallel.compile_cache import compiled

_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)


class Budget(NamedTuple):
    """How many quadrature points an event gets, and how much wider the proposals are than what they follow.

    On a line only the total of the numbers counts.

    Attributes
    ----------
    around_mode, over_population : int
        Powers of 2, as those below.
    adapted : int
        Put where the others have found the weight to be: around modes that nobody looked for, along the
        edges that stops make.
    wider : float
        Than the linear model at the mode.
    population_wider : float
        Than the population, and than what the adapted ones follow.
    """

    around_mode: int = 16
    over_population: int = 32
    adapted: int = 64
    wider: float = 1.35
    population_wider: float = 1.6

    @property
    def total(self) -> int:
        """All of an event's points."""
        return self.around_mode + self.over_population + self.adapted

    def times(self, more: int) -> Budget:
        """So many times the points."""
        return self._replace(
            around_mode=more * self.around_mode,
            over_population=more * self.over_population,
            adapted=more * self.adapted,
        )

    @property
    def halved(self) -> Budget:
        """Half the points."""
        return self._replace(
            around_mode=self.around_mode // 2,
            over_population=self.over_population // 2,
            adapted=self.adapted // 2,
        )


USUAL = Budget()
"""Of every integral that counts: the same for all that is compared, so that errors left are alike."""
FIRST = Budget(32, 16, 0)
"""Of rounds that only move the population."""
FINE = Budget(256, 128, 512, 1.5, 1.8)
"""Of re-computed evidence, and of the base law under each error model."""
SCREENING = Budget(16, 32, 32)
"""Of the look at every place, which only says where to look closer."""
_SHRUNK = 3.0
"""As how many effective nodes the linear model counts for the covariance that points are adapted to."""


class Spread(NamedTuple):
    """Quadrature points of all rows, as many each.

    Attributes
    ----------
    points : (n_rows, n_nodes, n_base + 1) array
        The release's deviation last.
    log_weights : (n_rows, n_nodes) array
    log_widths : (n_rows, n_nodes) or (n_rows, 0) array
        Log of what each stands for, on a line. Random points are each avalanche's own, so that no population
        has more than all of itself at those of all.
    """

    points: FloatArray
    log_weights: FloatArray
    log_widths: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Spread]) -> Spread:
        """Those of some rows, then those of others."""
        return cls(*(np.concatenate(values) for values in zip(*parts, strict=True)))

    def log_shares(self, population: Population, rows: Rows) -> FloatArray:
        """Log of each point's share of its row's integral over a population, (n_rows, n_nodes)."""
        log_terms = self.log_weights + self._log_prior(population, rows)
        shares: FloatArray = log_terms - np.logaddexp.reduce(log_terms, axis=1, keepdims=True)
        return shares

    def log_integrals(self, population: Population, rows: Rows) -> FloatArray:
        """Log of each row's integral over a population, (n_rows,)."""
        log_prior = self._log_prior(population, rows)
        log_integrals = np.logaddexp.reduce(self.log_weights + log_prior, axis=1)
        if self.log_widths.size:
            log_integrals -= np.maximum(np.logaddexp.reduce(self.log_widths + log_prior, axis=1), 0.0)
        return np.asarray(log_integrals)

    def _log_prior(self, population: Population, rows: Rows) -> FloatArray:
        return _log_prior(population, rows, self.points[:, :, :-1])

    @property
    def nodes(self) -> Nodes:
        """As the compiled sums over a population read them."""
        n_rows, n_nodes, n = self.points.shape
        points = np.ascontiguousarray(self.points[:, :, : n - 1].reshape(-1, n - 1).T)
        first = n_nodes * np.arange(n_rows + 1)
        return Nodes(first, points, self.log_weights.ravel(), self.log_widths.ravel())


class _Part(NamedTuple):
    """A share of the points: a normal density for each row.

    Attributes
    ----------
    size : int
        Points of a row.
    centre : (n_rows, n_axes) array
    factor : (n_rows, n_axes, n_axes) array
    """

    size: int
    centre: FloatArray
    factor: FloatArray

    def points(self, numbers: FloatArray) -> FloatArray:
        """Points from normal numbers, both (n_rows, size, n_axes)."""
        return self.centre[:, None, :] + numbers @ self.factor.transpose(0, 2, 1)

    def log_density(self, points: FloatArray) -> FloatArray:
        """At points of the rows, (n_rows, k, n_axes) to (n_rows, k)."""
        whiten = np.linalg.inv(self.factor)
        log_scale = np.log(np.einsum("rii->ri", whiten)).sum(axis=1) - points.shape[2] * _LOG_SQRT_2PI
        given = map(np.ascontiguousarray, (points, self.centre, whiten))  # of one layout: compiled once
        return np.asarray(log_scale[:, None] - 0.5 * _squares(*given))


@compiled()
def _squares(points, centre, whiten):  # type: ignore[no-untyped-def]
    """Squared size of each row's deviations from its centre, whitened by a lower triangle, (n_rows, k)."""
    n_rows, n_points, n_axes = points.shape
    result = np.zeros((n_rows, n_points))
    for row in range(n_rows):
        for k in range(n_points):
            for i in range(n_axes):
                white = 0.0
                for j in range(i + 1):
                    white += whiten[row, i, j] * (points[row, k, j] - centre[row, j])
                result[row, k] += white**2
    return result


@cache
def _normal_numbers(n_events: int, n: int, n_axes: int, seed: int) -> FloatArray:
    """Quasi-random standard normal numbers, (n_events, n, n_axes): of its own for each event.

    With the same for all events, what is left of the integration errors would add up in one direction.
    """
    uniforms = [
        qmc.Sobol(n_axes, scramble=True, rng=np.random.default_rng([seed, event])).random(n)
        for event in range(n_events)
    ]
    return ndtri(np.clip(np.array(uniforms), 1e-12, 1.0 - 1e-12))


def event_nodes(
    likelihood: EventLikelihood,
    population: Population,
    modes: Modes,
    budget: Budget = USUAL,
    reference: Population | None = None,
    shifts: FloatArray | None = None,
) -> Spread:
    """Quadrature points of all rows, as many for each: on a line where one strength is free, else random.

    Parameters
    ----------
    population : Population
        Roughly where the events' strengths are.
    modes : Modes
        Around which many points are put.
    reference : Population, optional
        Other populations that the points of all rows must cover: those over the population are shared with
        them. Without any, a population that has become too narrow would never see what it misses.
    shifts : (n_rows, n_base + 1) array, optional
        By which each row's quasi-random numbers are moved round along each axis, 0 to 1. For means over
        rows, not differences: what is left of the integration errors then averages out. On a line, where
        nothing is random, nothing is moved.
    """
    if _axes(likelihood) == 1:
        return on_a_line(likelihood, population, modes, budget, reference)
    return importance_nodes(likelihood, population, modes, budget, reference, shifts)


def importance_nodes(
    likelihood: EventLikelihood,
    population: Population,
    modes: Modes,
    budget: Budget,
    reference: Population | None = None,
    shifts: FloatArray | None = None,
) -> Spread:
    """As `event_nodes`, over any number of strengths, with the release where it is uncertain.

    All are weighted by the mixture of all that was proposed, what was found by adaptation included (adaptive
    multiple importance sampling: Cornuet and others, 2012, doi 10.1111/j.1467-9469.2011.00756.x).
    """
    rows = likelihood.rows
    n, axes = population.mean.shape[1], _axes(likelihood)
    cover = _cover(rows, population, modes, axes)
    parts = [_Part(budget.around_mode, modes.points[:, :axes], budget.wider * np.linalg.cholesky(cover))]
    covered = _covered(population, reference)
    # As many as quasi-random numbers come in.
    size = 1 << ((budget.over_population // len(covered)).bit_length() - 1)
    for one in covered:
        centre, over = _over(one, rows, axes, budget.population_wider)
        parts.append(_Part(size, centre, over))

    def spread(part: _Part, seed: int) -> tuple[FloatArray, FloatArray]:
        """Points of a part, and the log likelihoods there, the release's prior included."""
        n_events = likelihood.extension.problem.campaign.n_events
        numbers = _normal_numbers(n_events, part.size, axes, seed)[rows.event]
        points = part.points(_rotated(numbers, shifts))
        return points, _log_likelihoods(likelihood, points)

    found = [spread(part, seed) for seed, part in enumerate(parts)]
    points, log_l = (np.concatenate([one[k] for one in found], axis=1) for k in range(2))
    log_weights = log_l - _log_proposal(parts, points)
    if budget.adapted:
        log_prior = _log_prior(population, rows, points[:, :, :n])
        parts.append(_adapted(points, log_weights + log_prior, cover, budget))
        more, log_more = spread(parts[-1], len(parts))
        points, log_l = np.concatenate([points, more], axis=1), np.concatenate([log_l, log_more], axis=1)
        log_weights = log_l - _log_proposal(parts, points)
    n_rows, n_nodes = log_weights.shape
    full = np.zeros((n_rows, n_nodes, n + 1))
    full[:, :, :axes] = points
    return Spread(full, log_weights - math.log(n_nodes), np.empty((n_rows, 0)))


def on_a_line(
    likelihood: EventLikelihood,
    population: Population,
    modes: Modes,
    budget: Budget,
    reference: Population | None = None,
) -> Spread:
    """As `event_nodes`, where one strength is all that is free; see `line_nodes`."""
    rows = likelihood.rows
    cover = _cover(rows, population, modes, 1)
    over = [_over(one, rows, 1, 1.0) for one in _covered(population, reference)]
    centres = np.column_stack([modes.points[:, 0], *(centre[:, 0] for centre, _ in over)])
    widths = [budget.wider * np.sqrt(cover[:, 0, 0])]
    widths += [budget.population_wider * factor[:, 0, 0] for _, factor in over]

    def log_likelihoods_at(points: FloatArray) -> FloatArray:
        return _log_likelihoods(likelihood, points[:, :, None])

    populations = centres[:, 1:], np.column_stack([factor[:, 0, 0] for _, factor in over])
    points, log_weights, log_widths = line_nodes(
        log_likelihoods_at, centres, np.column_stack(widths), populations, budget.total
    )
    full = np.zeros((*points.shape, 2))
    full[:, :, 0] = points
    return Spread(full, log_weights, log_widths)


def _axes(likelihood: EventLikelihood) -> int:
    """How many there are to integrate over: the base's strengths, and the release where it is uncertain."""
    extension = likelihood.extension
    return extension.n_base + int(extension.problem.releases.uncertain[likelihood.rows.event].any())


def _covered(population: Population, reference: Population | None) -> list[Population]:
    """The rows' own population first, then each that the points of all rows must cover."""
    return [population, *([] if reference is None else reference.groups)]


def _cover(rows: Rows, population: Population, modes: Modes, axes: int) -> FloatArray:
    """Covariance of the linear model about each row's mode, (n_rows, axes, axes)."""
    cover = np.linalg.inv(modes.information + population.precision[rows.group])[:, :axes, :axes]
    return 0.5 * (cover + cover.transpose(0, 2, 1))


def _log_likelihoods(likelihood: EventLikelihood, points: FloatArray) -> FloatArray:
    """At points, (n_rows, k, n_axes) to (n_rows, k); with the prior of a release that is an axis."""
    n_rows, size, axes = points.shape
    extension, rows, n = likelihood.extension, likelihood.rows, likelihood.extension.n_base
    flat = np.zeros((n_rows * size, n + 1))
    flat[:, :axes] = points.reshape(-1, axes)
    which = np.repeat(np.arange(n_rows), size)
    predictions = extension.predict(rows.event[which], flat, likelihood.given[which])
    log_l: FloatArray = log_likelihoods(which, predictions, rows.readings, rows.errors)
    if axes > n:
        log_l = log_l - 0.5 * flat[:, n] ** 2 - _LOG_SQRT_2PI
    return log_l.reshape(n_rows, size)


def _log_proposal(parts: list[_Part], points: FloatArray) -> FloatArray:
    """Log density of the mixture of all parts, by their sizes."""
    total = sum(part.size for part in parts)
    terms = [math.log(part.size / total) + part.log_density(points) for part in parts]
    return np.asarray(np.logaddexp.reduce(terms, axis=0))


def _adapted(points: FloatArray, log_posterior: FloatArray, cover: FloatArray, budget: Budget) -> _Part:
    """Where weighted points say that each row's posterior is: its mean and, wider, its covariance.

    A mixture around single points depends on which points these are; this is smooth in the strengths, and off
    by less or as little (``studies.thresholds.event_nodes``).
    """
    weights = np.exp(log_posterior - log_posterior.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    effective = 1.0 / np.sum(weights**2, axis=1)
    mean = np.sum(weights[:, :, None] * points, axis=1)
    deviation = points - mean[:, None, :]
    covariance = deviation.transpose(0, 2, 1) @ (weights[:, :, None] * deviation)
    shrink = (_SHRUNK / (_SHRUNK + effective))[:, None, None]
    covariance = shrink * cover + (1.0 - shrink) * covariance
    return _Part(budget.adapted, mean, budget.population_wider * np.linalg.cholesky(covariance))


def _rotated(numbers: FloatArray, shifts: FloatArray | None) -> FloatArray:
    """Normal numbers, (n_rows, n, n_axes), their quantiles moved round by each row's shifts."""
    if shifts is None:
        return numbers
    quantiles = (ndtr(numbers) + shifts[:, None, : numbers.shape[2]]) % 1.0
    return ndtri(np.clip(quantiles, 1e-12, 1.0 - 1e-12))


def _over(population: Population, rows: Rows, axes: int, wider: float) -> tuple[FloatArray, FloatArray]:
    """Centre and factor of a proposal over a whole population, for each row."""
    n = population.mean.shape[1]
    group = rows.group if len(population.mean) > 1 else np.zeros_like(rows.group)
    centre, factor = np.zeros((len(group), axes)), np.zeros((len(group), axes, axes))
    centre[:, :n] = population.mean[group]
    factor[:, :n, :n] = wider * np.linalg.cholesky(population.covariance)[group]
    if axes > n:
        factor[:, n, n] = 1.0
    return centre, factor


def _log_prior(population: Population, rows: Rows, points: FloatArray) -> FloatArray:
    """Log density of a population at points of the rows, (n_rows, k, n_base) to (n_rows, k)."""
    centre, over = _over(population, rows, points.shape[2], 1.0)
    return _Part(0, centre, over).log_density(points)
