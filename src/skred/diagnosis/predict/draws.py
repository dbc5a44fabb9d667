"""What the other avalanches say of one: draws of the population, and of the coefficients of what is added."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.augment.added_strength import new_rows
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    event_modes,
    log_joint,
)
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.predictive import Predicted, predict_event
from skred.inference.calibrate import Calibration
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.rough_population import moments_of
from skred.inference.leave_one_out import Samples
from skred.parallel.threads import side_by_side

_FRONTS = 1200
"""New fronts of these populations that an avalanche's readings are predicted by: six of each."""


class Draws(NamedTuple):
    """Draws of populations, and of the strengths of what is added, (n_draws, ...)."""

    means: FloatArray
    factors: FloatArray
    strengths: FloatArray

    def take(self, chosen: IntArray) -> Draws:
        """Some of them, perhaps repeated."""
        return Draws(*(values[chosen] for values in self))

    def so_many(self, n: int) -> Draws:
        """The first of them, or all again and again."""
        return self.take(np.resize(np.arange(len(self.means)), n))

    def points(self, n_each: int, rng: np.random.Generator) -> FloatArray:
        """Avalanches from each population: own logarithms and the release, (n_draws, n_each, n_base + 1)."""
        n, n_base = self.means.shape
        normal = rng.standard_normal((n, n_each, n_base + 1))
        logs = self.means[:, None] + normal[..., :-1] @ self.factors.transpose(0, 2, 1)
        return np.concatenate([logs, normal[..., -1:]], axis=2)

    @property
    def covariances(self) -> FloatArray:
        """Of the populations, (n_draws, n_base, n_base)."""
        found: FloatArray = self.factors @ self.factors.transpose(0, 2, 1)
        return found

    @property
    def typical(self) -> Population:
        """One population for all draws, as wide as they are together."""
        mean, covariance = moments_of(self.means, self.factors)
        return Population(mean[None], covariance[None])


class LeftOut(NamedTuple):
    """What a law says of an avalanche by the others.

    Attributes
    ----------
    extension : Extension
        The law with what is added to it.
    draws : Draws
        Of the posterior without the avalanche, all of the same weight.
    """

    extension: Extension
    draws: Draws


def draws_of(calibration: Calibration, samples: Samples, rng: np.random.Generator) -> Draws:
    """Populations of a calibrated law, and what one avalanche from each has of what is added.

    Parameters
    ----------
    samples : mapping
        Arrays by name of parameter: of the calibration, or of a refit of it.
    """
    problem = calibration.problem
    means, factors = population_of(calibration.law, samples)
    if isinstance(problem, AugmentedProblem):
        return Draws(means, factors, new_rows(problem.added, samples, rng, 1)[:, 0])
    assert isinstance(problem, HierarchicalProblem)
    return Draws(means, factors, np.empty((len(means), 0)))


def predictions(others: Sequence[LeftOut], seed: int) -> Predicted:
    """Each avalanche's readings as predicted by the others, (n_events, n_sensors) each; seen or not."""

    def of_event(event: int) -> Predicted:
        extension, draws = others[event]
        rng = np.random.default_rng([seed, 32, event])
        return predict_event(extension, event, *draws.so_many(_FRONTS), rng)

    parts = side_by_side(of_event, range(len(others)))
    return Predicted(*(np.array(values) for values in zip(*parts, strict=True)))


def modes_near(likelihood: EventLikelihood, population: Population, tried: FloatArray) -> Modes:
    """Each row's most probable point, climbed to from the best of all that are tried, (..., n_base + 1)."""
    flat, n_rows = tried.reshape(-1, tried.shape[-1]), len(likelihood.rows.event)
    many = likelihood.take(np.repeat(np.arange(n_rows), len(flat)))
    heights = log_joint(many, np.tile(flat, (n_rows, 1)), population).reshape(n_rows, -1)
    return event_modes(likelihood, flat[heights.argmax(axis=1)], population)
