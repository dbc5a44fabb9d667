"""The linear mixed model around the events' own modes: population fit, efficient scores and information.

Around its mode, an event's readings are linear in its own strengths, in its release and in the strength of
anything added; the population makes the own strengths random. The population's mean, the events' own
deviations and the releases have their share first; what is left of a direction is its efficient score and
information (Lindstrom and Bates, 1990, doi 10.2307/2532087). It is linearised at each event's own mode,
never at the population's mean: that would alarm on clean recordings with small errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    Rows,
    deviations,
    event_modes,
)
from skred.inference.hierarchical.rough_population import (
    MEDIAN_LOG_MEAN,
    MEDIAN_LOG_SD,
    PRIOR_EVENTS,
    SPREAD_LOG_SD,
    SPREAD_MEDIAN,
    STARTING_SPREAD,
)
from skred.physics.law import Law


class MeanPrior(NamedTuple):
    """Normal prior of the population mean, (n_base,) each."""

    mean: FloatArray
    sd: FloatArray


def mean_prior(law: Law) -> MeanPrior:
    """Prior of the population mean of a law's log strengths, as its half-normal priors say roughly."""
    scales = np.array([mechanism.strength.prior_scale for mechanism in law.mechanisms])
    return MeanPrior(np.log(scales) + MEDIAN_LOG_MEAN, np.full(len(scales), MEDIAN_LOG_SD))


def median_log_scale(law: Law) -> FloatArray:
    """Logarithm of the scales of the medians' half-normal priors, as `mean_prior` stands for them."""
    return mean_prior(law).mean - MEDIAN_LOG_MEAN


class Scores(NamedTuple):
    """Efficient scores and information about the strengths added, by group.

    Attributes
    ----------
    score : (n_groups, n_directions) array
    information : (n_groups, n_directions, n_directions) array
    raw : (n_groups, n_directions) array
        Information before population and releases had their share.
    """

    score: FloatArray
    information: FloatArray
    raw: FloatArray

    @property
    def own(self) -> FloatArray:
        """Information about each strength if all others are nil, (n_groups, n_directions)."""
        return np.maximum(_diagonal(self.information), 1e-300)


def _diagonal(matrices: FloatArray) -> FloatArray:
    """Diagonals of many matrices, (n, k)."""
    return np.array(np.einsum("gii->gi", matrices))


def _by_group(rows: Rows, values: FloatArray) -> FloatArray:
    """Sum over the rows of each group; groups have equally many rows, one after the other."""
    return values.reshape(rows.n_groups, -1, *values.shape[1:]).sum(axis=1)


def _products(rows: Rows, first: FloatArray, second: FloatArray) -> FloatArray:
    """Products of two matrices (n_rows, k, n) over k, summed over each group's rows, (n_groups, n, n)."""
    one, other = (part.reshape(rows.n_groups, -1, part.shape[2]) for part in (first, second))
    return one.transpose(0, 2, 1) @ other


class NormalEquations(NamedTuple):
    """Those of the population's means and of what is added, by group, the events' points integrated out.

    Attributes
    ----------
    score : (n_groups, n_base + n_added) array
    information : (n_groups, n_base + n_added, n_base + n_added) array
    along : (n_rows, n_base + 1) array
        What each event's point moves by itself.
    by_both : (n_rows, n_base + 1, n_base + n_added) array
        What it moves with means and what is added.
    """

    score: FloatArray
    information: FloatArray
    along: FloatArray
    by_both: FloatArray


def _normal_equations(modes: Modes, rows: Rows, population: Population, prior: MeanPrior) -> NormalEquations:
    """Of means and of the directions of the modes, in the linear model around these."""
    n, added = population.mean.shape[1], modes.by_strengths
    precision, deviation = population.precision[rows.group], deviations(modes.points, rows, population)
    information, weighted = modes.information, modes.weighed(added)
    cover = np.linalg.inv(information + precision)
    mixed = modes.by_points.transpose(0, 2, 1) @ weighted
    by_means, by_added = cover @ precision[:, :, :n], -cover @ mixed
    slope = np.einsum("rij,ri->rj", modes.by_points, modes.slope)
    pull = slope - np.einsum("rij,rj->ri", precision, deviation)
    # Of means as products, for a difference from the precision has few digits left where spreads are narrow.
    of_means = np.einsum("rij,ri->rj", by_means, slope + np.einsum("rij,rj->ri", information, deviation))
    of_added = np.einsum("rij,ri->rj", added, modes.slope) + np.einsum("rij,ri->rj", by_added, pull)
    score = _by_group(rows, np.concatenate([of_means, of_added], axis=1))
    score[:, :n] += (prior.mean - population.mean) / prior.sd**2
    own = _products(rows, by_means, information[:, :, :n]) + np.diag(prior.sd**-2.0)
    crossed = _products(rows, by_means, mixed)
    left = _products(rows, added, weighted) + _products(rows, mixed, by_added)
    total = np.block([[own, crossed], [crossed.transpose(0, 2, 1), left]])
    along = np.einsum("rij,rj->ri", cover, pull)
    return NormalEquations(score, total, along, np.concatenate([by_means, by_added], axis=2))


def _left(score: FloatArray, information: FloatArray, n_first: int) -> tuple[FloatArray, FloatArray]:
    """Score and information of the others once the first ones have had their share."""
    first, rest = slice(0, n_first), slice(n_first, None)
    own, crossed = information[:, first, first], information[:, first, rest]
    # Their units differ, so each has its own; one of which nothing is known takes nothing.
    least = np.maximum(1e-12 * _diagonal(own), 1e-300)
    solved = np.linalg.solve(own + least[:, :, None] * np.eye(n_first), crossed)
    return (
        score[:, rest] - np.einsum("gij,gi->gj", solved, score[:, first]),
        information[:, rest, rest] - crossed.transpose(0, 2, 1) @ solved,
    )


def efficient_scores(
    modes: Modes,
    rows: Rows,
    population: Population,
    prior: MeanPrior,
    precision_in: FloatArray | None = None,
) -> Scores:
    """Efficient scores and information of the directions of the modes.

    Parameters
    ----------
    precision_in : (n_in,) array, optional
        Of the first directions, which are in already and have their share too: the precisions of their normal
        priors about where they are, 0 where they are free.
    """
    n, precision_in = population.mean.shape[1], np.zeros(0) if precision_in is None else precision_in
    n_in = len(precision_in)
    of_all, added = _normal_equations(modes, rows, population, prior), modes.by_strengths[:, :, n_in:]
    own = np.arange(n, n + n_in)
    of_all.information[:, own, own] += precision_in
    score, information = _left(of_all.score, of_all.information, n + n_in)
    raw = _by_group(rows, np.einsum("rij,rij->rj", added, modes.weighed(added)))
    return Scores(score, information, raw)


class JointStep(NamedTuple):
    """A step of the population's means and of one coefficient, which the events' points follow; by group.

    Attributes
    ----------
    mean : (n_groups, n_base) array
    strength : (n_groups,) array
    sd : (n_groups,) array
        Of the coefficient, everything else free.
    equations : NormalEquations
        Which it solves.
    """

    mean: FloatArray
    strength: FloatArray
    sd: FloatArray
    equations: NormalEquations

    def held(self, groups: IntArray, strength: FloatArray) -> JointStep:
        """With the coefficient's step given in some groups, the means' as that asks for."""
        if len(groups) == 0:
            return self
        n, score, information = self.mean.shape[1], self.equations.score, self.equations.information
        mean, changed = self.mean.copy(), self.strength.copy()
        left = score[groups, :n] - information[groups, :n, n] * strength[groups, None]
        mean[groups] = np.linalg.solve(information[groups, :n, :n], left[:, :, None])[:, :, 0]
        changed[groups] = strength[groups]
        return self._replace(mean=mean, strength=changed)

    def of_points(self, share: float, rows: Rows) -> FloatArray:
        """What the events' points move by, (n_rows, n_base + 1), with a share of the step.

        None by more than 1, a factor e, with the whole step: tangents say nothing of what is farther.
        """
        both = np.column_stack([self.mean, self.strength])[rows.group]
        whole = self.equations.along + np.einsum("rij,rj->ri", self.equations.by_both, both)
        size = np.maximum(np.abs(whole).max(axis=1, keepdims=True), 1.0)
        return share * whole / size


def joint_step(
    modes: Modes,
    rows: Rows,
    population: Population,
    prior: MeanPrior,
    strengths: FloatArray,
    precision: float,
) -> JointStep:
    """Newton's step of means and of the last coefficient together, in the linear model around the modes.

    Parameters
    ----------
    strengths : (n_groups,) array
        Of the last coefficient.
    precision : float
        Of its normal prior about 0.
    """
    n = population.mean.shape[1]
    last = modes._replace(by_strengths=modes.by_strengths[:, :, -1:])
    equations = _normal_equations(last, rows, population, prior)
    equations.score[:, n] -= precision * strengths
    equations.information[:, n, n] += precision
    step = np.linalg.solve(equations.information, equations.score[:, :, None])[:, :, 0]
    sd = np.sqrt(np.linalg.inv(equations.information)[:, n, n])
    return JointStep(step[:, :n], step[:, n], sd, equations)


def fit_population(
    likelihood: EventLikelihood,
    prior: MeanPrior,
    start: tuple[Population, FloatArray],
    n_rounds: int = 25,
    tolerance: float = 5e-3,
) -> tuple[Population, FloatArray]:
    """Most probable population of each group, by expectation-maximisation around the modes.

    Parameters
    ----------
    likelihood : EventLikelihood
        Strengths of what is added are held fixed.
    start : (Population, (n_rows, n_base + 1) array)
        Population and points to begin with.

    Returns
    -------
    population : Population
    points : (n_rows, n_base + 1) array
        The modes.
    """
    population, points = start
    rows = likelihood.rows
    n, per_group = population.mean.shape[1], len(rows.event) // rows.n_groups
    for _ in range(n_rounds):
        modes = event_modes(likelihood, points, population, n_steps=2)
        points = modes.points
        cover = np.linalg.inv(modes.information + population.precision[rows.group])
        # The mean by a full step of its linear model, the spreads by expectation.
        precision = np.linalg.inv(population.covariance)
        deviation = deviations(points, rows, population)[:, :n]
        score = np.einsum("gij,gj->gi", precision, _by_group(rows, deviation))
        score += (prior.mean - population.mean) / prior.sd**2
        lost = np.einsum("gij,gjk,gkl->gil", precision, _by_group(rows, cover[:, :n, :n]), precision)
        total = per_group * precision - lost + np.diag(prior.sd**-2.0)
        step = np.clip(np.linalg.solve(total, score[:, :, None])[:, :, 0], -0.5, 0.5)
        covariance = most_probable_covariance(rows, deviation, cover[:, :n, :n])
        change = max(
            float(np.abs(step / np.sqrt(_diagonal(covariance))).max()),
            float(np.abs(np.log(_diagonal(covariance) / _diagonal(population.covariance))).max()),
        )
        population = Population(population.mean + step, covariance)
        if change < tolerance:
            break
    return population, event_modes(likelihood, points, population).points


def most_probable_covariance(rows: Rows, deviation: FloatArray, cover: FloatArray) -> FloatArray:
    """Covariance of each group's population, (n_groups, n, n), that its events ask for.

    Most probable spreads under their log-normal prior, mild correlation.

    Parameters
    ----------
    deviation : (n_rows, n) array
        Of the events' modes from the population's mean.
    cover : (n_rows, n, n) array
        What is left open of them.
    """
    moment = _by_group(rows, np.einsum("ri,rj->rij", deviation, deviation) + cover)
    squares, n_events = _diagonal(moment), len(rows.event) // rows.n_groups
    log_spread = 0.5 * np.log(squares / n_events + 1e-12)
    for _ in range(12):
        ratio = squares * np.exp(-2.0 * log_spread)
        slope = n_events - ratio + (log_spread - math.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD**2
        log_spread = log_spread - np.clip(slope / (2.0 * ratio + SPREAD_LOG_SD**-2.0), -1.0, 1.0)
    regular = moment + PRIOR_EVENTS * SPREAD_MEDIAN**2 * np.eye(moment.shape[1])
    scale = np.sqrt(_diagonal(regular))
    spread = np.exp(log_spread)
    return regular * (spread / scale)[:, :, None] * (spread / scale)[:, None, :]


def starting_population(law: Law) -> Population:
    """A wide population at the prior's median strengths, of one group."""
    mean = mean_prior(law).mean
    return Population(mean[None], STARTING_SPREAD**2 * np.eye(len(mean))[None])
