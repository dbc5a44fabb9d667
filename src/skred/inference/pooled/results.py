"""Results of a pooled posterior: the mean response of the path, and readings of a new avalanche."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.inference.by_sensor import predicted_by_sensor
from skred.inference.fit import fit_entries
from skred.inference.intervals import interval
from skred.inference.pooled.problem import PooledProblem
from skred.inference.results import chain_and_draw, predictive, summary
from skred.physics.law import Law


@predictive.register
def pooled_predictive(
    problem: PooledProblem, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
) -> dict[str, xr.Dataset]:
    """Predictive groups of a result.

    Groups
    ------
    mean_response : ``response`` (chain, draw, release, sensor), the response of the path
    new_avalanches : ``reading`` (chain, draw, event, sensor), a latent reading of a new avalanche from each
        event's release, y ~ N(response, Sigma): at most 0 where it would not have been reached
    posterior_predictive : see `predicted_readings`; by sensor
    prior_predictive : likewise
    """
    rng = np.random.default_rng([seed, 1])
    groups = _new_avalanches(problem, law, posterior, rng)
    before = _new_avalanches(problem, law, prior, rng)
    return {
        **groups,
        "posterior_predictive": _by_sensor(problem, groups, seed),
        "prior_predictive": _by_sensor(problem, before, seed),
    }


def _new_avalanches(
    problem: PooledProblem, law: Law, parameters: xr.Dataset, rng: np.random.Generator
) -> dict[str, xr.Dataset]:
    """The response of the path, and latent readings that scatter about it."""
    response = _response(problem, law, parameters)
    draws = response.values[:, :, problem.release_of_event]
    factor = np.linalg.cholesky(problem.covariance)
    reading = draws + rng.standard_normal(draws.shape) @ factor.T
    return {
        "mean_response": xr.Dataset({"response": response}),
        "new_avalanches": xr.Dataset(
            {"reading": (("chain", "draw", "event", "sensor"), reading, response.attrs)},
            coords={**chain_and_draw(parameters), **problem.coords},
        ),
    }


def _by_sensor(problem: PooledProblem, groups: dict[str, xr.Dataset], seed: int) -> xr.Dataset:
    shape = groups["new_avalanches"]["reading"].shape
    readings = predicted_readings(problem, groups, seed).reshape(shape)
    return predicted_by_sensor(problem, readings, chain_and_draw(groups["new_avalanches"]))


def _response(problem: PooledProblem, law: Law, parameters: xr.Dataset) -> xr.DataArray:
    """Mean response, (chain, draw, release, sensor)."""
    rows = law.strength_rows({name: parameters[name].values.ravel() for name in law.parameter_names})
    of_event = problem.simulate(law.mechanisms, rows)
    first_event = [
        int(np.flatnonzero(problem.release_of_event == k)[0]) for k in range(len(problem.releases))
    ]
    sizes = (parameters.sizes["chain"], parameters.sizes["draw"])
    return xr.DataArray(
        of_event[:, first_event].reshape(*sizes, len(first_event), -1),
        dims=("chain", "draw", "release", "sensor"),
        coords={
            **chain_and_draw(parameters),
            "release": problem.releases,
            "release_speed": ("release", problem.release_speeds, {"units": "m s-1"}),
            "sensor": problem.coords["sensor"],
        },
        attrs={"units": "m s-1; m for the runout"},
    )


@summary.register
def pooled_summary(problem: PooledProblem, law: Law, tree: xr.DataTree) -> dict[str, Any]:
    """Mean response at each sensor, and the check of fit."""
    groups = {name: tree[name].to_dataset() for name in ("mean_response", "new_avalanches")}
    return {
        "response": response_rows(problem, tree),
        **fit_entries(problem, predicted_readings(problem, groups, int(tree.attrs["seed"]))),
    }


def predicted_readings(problem: PooledProblem, groups: Mapping[str, xr.Dataset], seed: int) -> FloatArray:
    """Recordings that the model predicts, (n, n_events, n_sensors), for the check of fit.

    At each sensor the covariance was estimated from the recordings, so that recordings of other avalanches
    scatter about the mean response as Student's t, with one degree of freedom less than there are readings.
    """
    shape = (-1, problem.campaign.n_events, problem.campaign.n_sensors)
    response = (
        groups["mean_response"]["response"].isel(release=problem.release_of_event).values.reshape(shape)
    )
    known = (problem.observed | problem.not_reached).sum(axis=0)
    degrees = np.maximum(known - 1.0, 1.0)
    rng = np.random.default_rng([seed, 3])
    widened = np.sqrt(degrees / rng.chisquare(degrees, (len(response), 1, len(degrees))))
    latent = response + widened * (groups["new_avalanches"]["reading"].values.reshape(shape) - response)
    # A latent velocity below 0 is that of a front that does not come.
    is_velocity = np.array([not sensor.is_runout for sensor in problem.campaign.sensors])
    return np.where(is_velocity, np.maximum(latent, 0.0), latent)


def response_rows(problem: PooledProblem, tree: xr.DataTree) -> list[dict[str, Any]]:
    """Mean response at each sensor, averaged over the events, beside the recordings' mean."""
    response = tree["mean_response"].to_dataset()["response"]
    mean_over_events = response.isel(release=problem.release_of_event).mean("release")
    rows = []
    for number, sensor in enumerate(problem.campaign.sensors):
        values = np.asarray(mean_over_events.isel(sensor=number).to_numpy(), dtype=float)
        low, high = interval(values)
        recorded = int(problem.observed[:, number].sum())
        rows.append(
            {
                "sensor": sensor.id,
                "unit": "m" if sensor.is_runout else "m/s",
                "mean": float(values.mean()),
                "sd": float(values.std(ddof=1)),
                "low": low,
                "high": high,
                "recorded_mean": float(problem.recorded_mean[number]),
                "recorded_se": float(np.sqrt(problem.covariance[number, number] / problem.campaign.n_events)),
                "n_recorded": recorded,
            }
        )
    return rows
