"""What a hierarchical posterior says of avalanches: of each recorded one, and of the next one."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from skred.inference.event_draws import (
    fronts_of,
    new_avalanches,
    read_with_errors,
    recorded_avalanches,
)
from skred.inference.hierarchical import HierarchicalProblem
from skred.physics.law import Law

MOST_AVALANCHES = 200_000
"""Draws times events kept of single avalanches; beyond that draws are thinned."""
_READING = {"units": "m s-1; m for the runout"}


def predictive_groups(
    problem: HierarchicalProblem, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
) -> dict[str, xr.Dataset]:
    """Predictive groups of a result; draws are thinned where there are many events.

    Groups
    ------
    event_posterior : each strength by its name, ``release`` (chain, draw, event), and ``front``
        (chain, draw, event, sensor): the recorded avalanches themselves, readings without errors
    posterior_predictive : of a new avalanche from each event's release, its strengths, ``release``,
        ``front`` (readings without errors, 0 where it does not come), ``reading`` (with errors) and
        ``reached`` (chain, draw, event, sensor)
    prior_predictive : the same from the prior
    """
    rng = np.random.default_rng([seed, 1])
    thinned = _thin(posterior, problem.campaign.n_events)
    samples = _samples(problem, law, thinned)
    recorded = recorded_avalanches(problem, law, samples, rng)
    event_posterior = _avalanches(problem, law, thinned, recorded, fronts_of(problem, law, recorded))
    return {
        "event_posterior": event_posterior,
        "posterior_predictive": _predict(problem, law, thinned, rng),
        "prior_predictive": _predict(problem, law, _thin(prior, problem.campaign.n_events), rng),
    }


def _thin(draws: xr.Dataset, n_events: int) -> xr.Dataset:
    n = draws.sizes["chain"] * draws.sizes["draw"]
    return draws.isel(draw=slice(None, None, max(1, -(-n * n_events // MOST_AVALANCHES))))


def _samples(problem: HierarchicalProblem, law: Law, draws: xr.Dataset) -> dict[str, Any]:
    return {p.name: draws[p.name].values.ravel() for p in problem.parameters(law)}


def _predict(
    problem: HierarchicalProblem, law: Law, draws: xr.Dataset, rng: np.random.Generator
) -> xr.Dataset:
    avalanches = new_avalanches(problem, law, _samples(problem, law, draws), rng)
    fronts = fronts_of(problem, law, avalanches)
    dataset = _avalanches(problem, law, draws, avalanches, fronts)
    readings, reached = read_with_errors(problem, fronts, rng)
    shape = dataset["front"].shape
    dims = ("chain", "draw", "event", "sensor")
    dataset["reading"] = (dims, readings.reshape(shape), _READING)
    dataset["reached"] = (dims, reached.reshape(shape))
    return dataset


def _avalanches(
    problem: HierarchicalProblem, law: Law, draws: xr.Dataset, avalanches: Any, fronts: Any
) -> xr.Dataset:
    sizes = (draws.sizes["chain"], draws.sizes["draw"], problem.campaign.n_events)
    dims = ("chain", "draw", "event")
    variables: dict[str, Any] = {
        mechanism.strength.name: (
            dims,
            avalanches.strengths[..., k].reshape(sizes),
            {"units": mechanism.strength.unit, "symbol": mechanism.strength.symbol},
        )
        for k, mechanism in enumerate(law.mechanisms)
    }
    variables["release"] = (dims, avalanches.releases.reshape(sizes), {"units": "m"})
    variables["front"] = ((*dims, "sensor"), fronts[..., :-1].reshape(*sizes, -1), _READING)
    coords = {"chain": draws["chain"].values, "draw": draws["draw"].values, **problem.coords}
    return xr.Dataset(variables, coords=coords)
