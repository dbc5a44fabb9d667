"""What a posterior with mechanisms added says of avalanches: of each recorded one, and of the next one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.diagnosis.augment.added_strength import components_of, new_rows
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.inference.hierarchical.event_density import draw_nodes
from skred.inference.hierarchical.event_draws import Avalanches, new_points
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.results import (
    add_readings,
    avalanche_dataset,
    readings_by_sensor,
    thinned,
)
from skred.inference.results import draws_by_name, predictive
from skred.physics.geometry import sensor_table
from skred.physics.law import Law


@predictive.register
def augmented_predictive(
    problem: AugmentedProblem, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
) -> dict[str, xr.Dataset]:
    """Groups as `hierarchical_predictive` in `skred.inference` gives them, with what is added.

    Strengths of an avalanche contain the effect of a covariate, releases their offset, fronts the factor
    of a sensor: what it would read but for errors. The prior's added strengths are within the tables.
    """
    rng = np.random.default_rng([seed, 1])
    n_events = problem.campaign.n_events
    kept = thinned(posterior, n_events)
    samples = draws_by_name(problem, law, kept)
    own = recorded_strengths(problem, law, samples, rng)
    points = recorded_points(problem, law, samples, own, rng)
    recorded, fronts = fronts_of(problem, points, own)
    new = _predict(problem, law, kept, rng)
    before = _predict(problem, law, thinned(prior, n_events), rng)
    return {
        "event_posterior": _with_added(problem, avalanche_dataset(problem, law, kept, recorded, fronts), own),
        "new_avalanches": new,
        "posterior_predictive": readings_by_sensor(problem, new, seed),
        "prior_predictive": readings_by_sensor(problem, before, seed),
    }


def _predict(problem: AugmentedProblem, law: Law, draws: xr.Dataset, rng: np.random.Generator) -> xr.Dataset:
    samples = draws_by_name(problem, law, draws)
    points = new_points(problem, law, samples, rng)
    own = new_rows(problem.added, samples, rng, problem.campaign.n_events)
    avalanches, fronts = fronts_of(problem, points, own)
    dataset = _with_added(problem, avalanche_dataset(problem, law, draws, avalanches, fronts), own)
    add_readings(problem, dataset, fronts, rng)
    return dataset


def _with_added(problem: AugmentedProblem, avalanches: xr.Dataset, own: FloatArray) -> xr.Dataset:
    """Avalanches with what each has of what is added, (n, n_events, n_added)."""
    dims = ("chain", "draw", "event")
    sizes = tuple(avalanches.sizes[dim] for dim in dims)
    units = [{"units": one.mechanism.strength.unit} for one in problem.added]
    return avalanches.assign(
        {one.name: (dims, own[..., k].reshape(sizes), units[k]) for k, one in enumerate(problem.added)}
    )


def recorded_strengths(
    problem: AugmentedProblem, law: Law, samples: Mapping[str, Any], rng: np.random.Generator
) -> FloatArray:
    """What each recorded avalanche has of what is added, (n, n_events, n_added), for each draw."""
    own, _ = components_of(problem.added, samples)
    if own.shape[1] == 1:
        return np.tile(own, (1, problem.campaign.n_events, 1))
    shares = np.cumsum(problem.probability_of_each(law, samples), axis=2)
    chosen = np.sum(rng.random(shares.shape[:2])[..., None] > shares[..., :-1], axis=2)
    return np.take_along_axis(own, chosen[:, :, None], axis=1)


def recorded_points(
    problem: AugmentedProblem,
    law: Law,
    samples: Mapping[str, Any],
    own: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Each recorded avalanche's own point, (n, n_events, n_base + 1), one for each draw of the population.

    A node of the nearest table by its share of the integral, moved to where it is in between the tables:
    nodes of the same number follow the events' modes from table to table.

    Parameters
    ----------
    own : (n, n_events, n_added) array
        What each has of what is added.
    """
    tables, n_events = problem.tables, problem.campaign.n_events
    means, factors = population_of(law, samples)
    flat = own.reshape(-1, own.shape[2])
    uniforms = rng.random((len(means), n_events))
    nearest = tables.grid.nearest(flat).reshape(-1, n_events)
    first, points, log_weights, _ = tables.nodes
    starts = first[:-1].reshape(-1, n_events)
    number = np.empty((len(means), n_events), dtype=np.int64)
    for event in range(n_events):
        for table in np.unique(nearest[:, event]):
            these = np.flatnonzero(nearest[:, event] == table)
            place = table * n_events + event
            drawn = draw_nodes(
                means[these], factors[these], uniforms[these, event : event + 1], first[place : place + 2],
                points, log_weights,
            )  # fmt: skip
            number[these, event] = drawn[:, 0] - first[place]
    corners, weights = tables.grid.around(flat)
    coordinates = np.vstack([points, tables.release])
    result = np.zeros((len(means), n_events, len(coordinates)))
    events = np.arange(n_events)
    for corner, weight in zip(corners.T, weights.T, strict=True):
        nodes = starts[corner.reshape(-1, n_events), events] + number
        result += weight.reshape(-1, n_events)[..., None] * np.moveaxis(coordinates[:, nodes], 0, -1)
    return result


def fronts_of(
    problem: AugmentedProblem, points: FloatArray, own: FloatArray
) -> tuple[Avalanches, FloatArray]:
    """Avalanches as they are with what is added, and their readings without errors.

    Parameters
    ----------
    points : (n, n_events, n_base + 1) array
    own : (n, n_events, n_added) array
        What each has of what is added.

    Returns
    -------
    avalanches : Avalanches
    fronts : (n, n_events, n_sensors + 1) array
        The runout last.
    """
    n, n_events = points.shape[:2]
    extension, events = problem.extension, np.tile(np.arange(n_events), n)
    given = problem.base.given(own.reshape(n * n_events, -1))
    runs = extension.inputs(events, points.reshape(n * n_events, -1), given)
    # As instruments read: 0 where a front does not come, spans as a whole.
    table = sensor_table([*problem.sensor_places, None])
    fronts = runs.read(problem.path, extension.contributions, table)
    avalanches = Avalanches(
        runs.strengths[:, : extension.n_base].reshape(n, n_events, -1),
        runs.releases.reshape(n, n_events),
        runs.speeds.reshape(n, n_events),
    )
    return avalanches, fronts.reshape(n, n_events, -1)
