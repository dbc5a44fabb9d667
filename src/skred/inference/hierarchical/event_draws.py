"""Draws of single avalanches: the recorded ones given their readings, and new ones from the population."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.inference.hierarchical.event_density import draw_nodes
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.law import Law

FARTHEST = 230.0
"""Largest absolute logarithm of a coefficient; powers of it stay finite."""


class Avalanches(NamedTuple):
    """Avalanches by population draw and event.

    Attributes
    ----------
    strengths : (n, n_events, n_strengths) array
    releases : (n, n_events) array, m
    release_speeds : (n, n_events) array, m/s
        How fast the fronts are there; 0 from rest.
    """

    strengths: FloatArray
    releases: FloatArray
    release_speeds: FloatArray


def recorded_avalanches(
    problem: HierarchicalProblem, law: Law, samples: Mapping[str, Any], rng: np.random.Generator
) -> Avalanches:
    """Each recorded avalanche's own strengths and release, one draw for each draw of the population."""
    means, factors = population_of(law, samples)
    surfaces = problem.surfaces(law.mechanisms)
    n_strengths, n_events = means.shape[1], problem.campaign.n_events
    node = draw_nodes(means, factors, rng.random((len(means), n_events)), *surfaces.nodes[:3])
    patch = node // (2 * n_strengths)
    variance, axes = np.linalg.eigh(surfaces.covariance)
    spread = axes * np.sqrt(np.maximum(variance, 0.0))[:, None, :]
    noise = rng.standard_normal((*patch.shape, n_strengths + 1))
    points = surfaces.mean[patch] + np.einsum("neij,nej->nei", spread[patch], noise)
    return _from(problem, np.exp(points[..., :n_strengths]), points[..., n_strengths])


def new_avalanches(
    problem: HierarchicalProblem, law: Law, samples: Mapping[str, Any], rng: np.random.Generator
) -> Avalanches:
    """A new avalanche from the release of each recorded one, for each draw of the population."""
    points = new_points(problem, law, samples, rng)
    return _from(problem, np.exp(points[..., :-1]), points[..., -1])


def new_points(
    problem: HierarchicalProblem, law: Law, samples: Mapping[str, Any], rng: np.random.Generator
) -> FloatArray:
    """The same as logarithms of the strengths and, last, the release's deviation in standard deviations.

    Returns
    -------
    (n, n_events, n_strengths + 1) array
    """
    means, factors = population_of(law, samples)
    n_events = problem.campaign.n_events
    noise = rng.standard_normal((len(means), n_events, means.shape[1]))
    logs = means[:, None, :] + np.einsum("nij,nej->nei", factors, noise)
    # Cut off at the same limits as in the likelihood.
    deviation = problem.releases.drawn(np.arange(n_events), rng.random((len(means), n_events)))
    # Where spreads are extremely wide a coefficient can exceed the largest number.
    return np.concatenate([np.clip(logs, -FARTHEST, FARTHEST), deviation[..., None]], axis=2)


def _from(problem: HierarchicalProblem, strengths: FloatArray, deviation: FloatArray) -> Avalanches:
    """Avalanches whose releases deviate from what was noted, (n, n_events), in standard deviations."""
    events, releases = np.arange(problem.campaign.n_events), problem.releases
    return Avalanches(strengths, releases.places(events, deviation), releases.speeds(events, deviation))


def fronts_of(problem: HierarchicalProblem, law: Law, avalanches: Avalanches) -> FloatArray:
    """Readings of the fronts without errors, (n, n_events, n_sensors + 1), the runout last."""
    shape = avalanches.releases.shape
    strengths = avalanches.strengths.reshape(-1, avalanches.strengths.shape[-1])
    begin = avalanches.releases.ravel(), avalanches.release_speeds.ravel()
    rows = problem.predict(law.mechanisms, strengths, *begin)
    return rows.reshape(*shape, -1)


def read_with_errors(
    problem: HierarchicalProblem, fronts: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, BoolArray]:
    """Readings that the instruments would record of fronts.

    Parameters
    ----------
    problem : HierarchicalProblem
    fronts : (..., n_sensors + 1) array
        As `fronts_of` gives them.
    rng : numpy Generator

    Returns
    -------
    readings : (..., n_sensors) array, m/s or m
        Velocities not below 0; 0 where the front does not come.
    reached : (..., n_sensors) boolean array
        Whether the front was seen there; always for a runout.
    """
    sensors, data = problem.sensors[:-1], problem.readings
    predicted, stop = fronts[..., :-1], fronts[..., -1:]
    readings = problem.error_model.draw(predicted, data.sensor_sd(predicted), data.is_velocity, rng)
    seen_stop = stop + problem.place_sd_m * rng.standard_normal(stop.shape)
    reached = np.where(data.is_velocity, sensors[:, 2] < seen_stop, True)
    readings = np.where(data.is_velocity, np.where(reached, np.maximum(readings, 0.0), 0.0), readings)
    return readings, reached
