"""Results of a hierarchical posterior: the recorded avalanches themselves, and new ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import BoolArray, FloatArray
from skred.inference.by_sensor import predicted_by_sensor
from skred.inference.fit import fit_entries
from skred.inference.hierarchical.event_draws import (
    fronts_of,
    new_avalanches,
    read_with_errors,
    recorded_avalanches,
)
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import interval
from skred.inference.results import chain_and_draw, draws_by_name, predictive, summary
from skred.physics.law import Law

MOST_AVALANCHES = 200_000
"""Most avalanches kept, draws times events; with more, draws are thinned."""
_READING = {"units": "m s-1; m for the runout"}


@predictive.register
def hierarchical_predictive(
    problem: HierarchicalProblem, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
) -> dict[str, xr.Dataset]:
    """Predictive groups of a result; draws are thinned where there are many events.

    Groups
    ------
    event_posterior : each strength by its name, ``release`` and ``release_speed`` (chain, draw, event), and
        ``front`` (chain, draw, event, sensor): the recorded avalanches themselves, readings without errors
    new_avalanches : of a new avalanche from each event's release, its strengths, ``release``,
        ``release_speed``, ``front`` (readings without errors, 0 where it does not come), ``reading`` (with
        errors) and ``reached`` (chain, draw, event, sensor)
    posterior_predictive : see `predicted_readings`; by sensor
    prior_predictive : likewise
    """
    rng = np.random.default_rng([seed, 1])
    kept = thinned(posterior, problem.campaign.n_events)
    samples = draws_by_name(problem, law, kept)
    recorded = recorded_avalanches(problem, law, samples, rng)
    event_posterior = avalanche_dataset(problem, law, kept, recorded, fronts_of(problem, law, recorded))
    new = _predict(problem, law, kept, rng)
    before = _predict(problem, law, thinned(prior, problem.campaign.n_events), rng)
    return {
        "event_posterior": event_posterior,
        "new_avalanches": new,
        "posterior_predictive": readings_by_sensor(problem, new, seed),
        "prior_predictive": readings_by_sensor(problem, before, seed),
    }


def thinned(draws: xr.Dataset, n_events: int) -> xr.Dataset:
    """Draws, thinned evenly if there are more avalanches than are kept."""
    n = draws.sizes["chain"] * draws.sizes["draw"]
    return draws.isel(draw=slice(None, None, max(1, -(-n * n_events // MOST_AVALANCHES))))


def _predict(
    problem: HierarchicalProblem, law: Law, draws: xr.Dataset, rng: np.random.Generator
) -> xr.Dataset:
    avalanches = new_avalanches(problem, law, draws_by_name(problem, law, draws), rng)
    fronts = fronts_of(problem, law, avalanches)
    dataset = avalanche_dataset(problem, law, draws, avalanches, fronts)
    add_readings(problem, dataset, fronts, rng)
    return dataset


def add_readings(
    problem: HierarchicalProblem, dataset: xr.Dataset, fronts: Any, rng: np.random.Generator
) -> None:
    """Readings of the fronts of a dataset, with errors, and whether each front came; added to it."""
    readings, reached = read_with_errors(problem, fronts, rng)
    shape, dims = dataset["front"].shape, dataset["front"].dims
    dataset["reading"] = (dims, readings.reshape(shape), _READING)
    dataset["reached"] = (dims, reached.reshape(shape))


def avalanche_dataset(
    problem: HierarchicalProblem, law: Law, draws: xr.Dataset, avalanches: Any, fronts: Any
) -> xr.Dataset:
    """Strengths, releases and fronts of avalanches, one of each event for each draw."""
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
    variables["release_speed"] = (dims, avalanches.release_speeds.reshape(sizes), {"units": "m s-1"})
    variables["front"] = ((*dims, "sensor"), fronts[..., :-1].reshape(*sizes, -1), _READING)
    coords = {"chain": draws["chain"].values, "draw": draws["draw"].values, **problem.coords}
    return xr.Dataset(variables, coords=coords)


@summary.register
def hierarchical_summary(problem: HierarchicalProblem, law: Law, tree: xr.DataTree) -> dict[str, Any]:
    """The error model, the check of fit, a new avalanche at each sensor, each event's own strengths."""
    return {
        "error_model": {"id": problem.error_model.id, "title": problem.error_model.title},
        "place_sd_m": problem.place_sd_m,
        "integration": problem.integration(law),
        **fit_entries(
            problem, predicted_readings(problem, tree["new_avalanches"].to_dataset(), int(tree.attrs["seed"]))
        ),
        "new_avalanche": new_avalanche_rows(problem, tree),
        "events": event_rows(problem, law, tree),
    }


def readings_by_sensor(problem: HierarchicalProblem, new: xr.Dataset, seed: int) -> xr.Dataset:
    """A predictive group, of the group new_avalanches."""
    readings = predicted_readings(problem, new, seed).reshape(new["front"].shape)
    return predicted_by_sensor(problem, readings, chain_and_draw(new))


def predicted_readings(problem: HierarchicalProblem, new: xr.Dataset, seed: int) -> FloatArray:
    """Recordings that the model predicts, (n, n_events, n_sensors), for the check of fit.

    Of the new avalanches of the result, each read with the errors that the recorded avalanche of the same
    release states; 0 where the front does not come.
    """
    data = problem.readings
    shape = (-1, problem.campaign.n_events, problem.campaign.n_sensors)
    fronts, reached = (new[name].values.reshape(shape) for name in ("front", "reached"))
    rng = np.random.default_rng([seed, 3])
    sd = data.sd(np.arange(problem.campaign.n_events), fronts)
    readings = problem.error_model.draw(fronts, sd, data.is_velocity, rng)
    came = np.where(reached, np.maximum(readings, 0.0), 0.0)
    return np.where(data.is_velocity, came, readings)


def new_avalanche_rows(problem: HierarchicalProblem, tree: xr.DataTree) -> list[dict[str, Any]]:
    """A new avalanche's reading at each sensor, where it comes there, beside the recorded ones."""
    predicted = tree["new_avalanches"].to_dataset()
    rows = []
    for number, sensor in enumerate(problem.campaign.sensors):
        reached = predicted["reached"].values[..., number]
        values = predicted["reading"].values[..., number][reached]
        recorded = problem.values[problem.observed[:, number], number]
        known = problem.observed[:, number] | problem.not_reached[:, number]
        row = {
            "sensor": sensor.id,
            "unit": "m" if sensor.is_runout else "m/s",
            "reached": float(reached.mean()),
            # As in the likelihood, a velocity of 0 does not show that the front came.
            "recorded_reached": _share(recorded > 0.0, known) if not sensor.is_runout else 1.0,
            "n_recorded": len(recorded),
        }
        for name, sample in (("", values), ("recorded_", recorded)):
            low, high = interval(sample) if len(sample) else (float("nan"), float("nan"))
            row[f"{name}mean"] = float(sample.mean()) if len(sample) else None
            row[f"{name}sd"] = float(sample.std(ddof=1)) if len(sample) > 1 else None
            row[f"{name}low"], row[f"{name}high"] = low, high
        rows.append(row)
    return rows


def _share(came: BoolArray, known: BoolArray) -> float | None:
    """Share of events that came, of those for which it is known."""
    return float(came.sum() / known.sum()) if known.any() else None


def event_rows(problem: HierarchicalProblem, law: Law, tree: xr.DataTree) -> list[dict[str, Any]]:
    """Each recorded avalanche's own strengths and release."""
    events = tree["event_posterior"].to_dataset()
    units = {m.strength.name: m.strength.unit for m in law.mechanisms} | {"release": "m"}
    if problem.releases.speed.any():
        units["release_speed"] = "m/s"
    rows = []
    for number, event in enumerate(problem.campaign.event_ids):
        row: dict[str, Any] = {"event": event}
        for name, unit in units.items():
            values = events[name].values[..., number]
            low, high = interval(values)
            row[name] = {"median": float(np.median(values)), "low": low, "high": high, "unit": unit}
        rows.append(row)
    return rows
