"""A calibration as one DataTree: named dims, units, and everything needed to trust or redo it."""

from __future__ import annotations

import json
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from skred.inference.gate import Gate
from skred.inference.problem import PooledProblem
from skred.inference.sampling import SamplerSettings
from skred.physics.law import Law

_PACKAGES = ("skred", "pymc", "pytensor", "arviz", "numba", "numpy", "scipy", "xarray")


def assemble(
    problem: PooledProblem,
    law: Law,
    posterior: xr.DataTree,
    prior: xr.Dataset,
    gate: Gate,
    settings: SamplerSettings,
) -> xr.DataTree:
    """Gather posterior, sample_stats, log_likelihood, predictive, prior, observed and constant data.

    Groups
    ------
    posterior, prior : parameters of the law
    posterior_predictive : ``mean_response`` (chain, draw, release, sensor), the response of the path,
        and ``reading`` (chain, draw, event, sensor), a latent reading of a new avalanche from each
        event's release, y ~ N(mean_response, Sigma): at most 0 where it would not have been reached
    prior_predictive : ``mean_response``
    log_likelihood : ``recordings`` (chain, draw, event)
    observed_data : ``reading`` (event, sensor), NaN where there is none
    constant_data : status, covariance of the recordings, sensors, track, terrain
    """
    parameters = posterior["posterior"].to_dataset()
    rng = np.random.default_rng([settings.seed, 1])
    response = _response(problem, law, parameters)
    draws = response.values[:, :, problem.release_of_event]
    factor = np.linalg.cholesky(problem.covariance)
    reading = draws + rng.standard_normal(draws.shape) @ factor.T
    log_density = problem.log_density(law.mechanisms, law.strength_rows(_flat(parameters, law)))
    sizes = (parameters.sizes["chain"], parameters.sizes["draw"])
    event, sensor = problem.coords["event"], problem.coords["sensor"]
    chain_draw = {"chain": parameters["chain"].values, "draw": parameters["draw"].values}
    groups = {
        "posterior": _with_units(parameters, law),
        "log_likelihood": xr.Dataset(
            {"recordings": (("chain", "draw", "event"), log_density.reshape(*sizes, -1))},
            coords={**chain_draw, "event": event},
        ),
        "posterior_predictive": xr.Dataset(
            {
                "mean_response": response,
                "reading": (("chain", "draw", "event", "sensor"), reading),
            },
            coords={**chain_draw, "event": event, "sensor": sensor},
        ),
        "prior": _with_units(prior, law),
        "prior_predictive": xr.Dataset({"mean_response": _response(problem, law, prior)}),
        "observed_data": _observed(problem),
        "constant_data": _constant(problem),
    }
    if "sample_stats" in posterior.children:
        groups["sample_stats"] = _storable(posterior["sample_stats"].to_dataset())
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = _attributes(problem, law, gate, settings)
    return tree


def save(tree: xr.DataTree, file: Path) -> None:
    """Write a tree as netCDF, whole or not at all."""
    partial = file.with_name(f".{file.name}.partial")
    tree.to_netcdf(partial, engine="h5netcdf")
    os.replace(partial, file)


def _flat(parameters: xr.Dataset, law: Law) -> dict[str, Any]:
    return {name: parameters[name].values.ravel() for name in law.parameter_names}


def _response(problem: PooledProblem, law: Law, parameters: xr.Dataset) -> xr.DataArray:
    """Mean response, (chain, draw, release, sensor)."""
    rows = law.strength_rows(_flat(parameters, law))
    of_event = problem.simulate(law.mechanisms, rows)
    first_event = [
        int(np.flatnonzero(problem.release_of_event == k)[0]) for k in range(len(problem.releases))
    ]
    sizes = (parameters.sizes["chain"], parameters.sizes["draw"])
    return xr.DataArray(
        of_event[:, first_event].reshape(*sizes, len(first_event), -1),
        dims=("chain", "draw", "release", "sensor"),
        coords={
            "chain": parameters["chain"].values,
            "draw": parameters["draw"].values,
            "release": problem.releases,
            "sensor": problem.coords["sensor"],
        },
        attrs={"units": "m s-1; m for the runout"},
    )


def _with_units(parameters: xr.Dataset, law: Law) -> xr.Dataset:
    labelled = parameters.copy()
    for parameter in (*law.parameters, *law.derived):
        if parameter.name not in labelled:
            continue  # the prior holds the free variables only
        labelled[parameter.name].attrs.update(units=parameter.unit, symbol=parameter.symbol)
    return labelled


def _observed(problem: PooledProblem) -> xr.Dataset:
    return xr.Dataset(
        {"reading": (("event", "sensor"), problem.values, {"units": "m s-1; m for the runout"})},
        coords=problem.coords,
    )


def _constant(problem: PooledProblem) -> xr.Dataset:
    campaign, terrain = problem.campaign, problem.terrain
    sensor = problem.coords["sensor"]
    return xr.Dataset(
        {
            "status": (
                ("event", "sensor"),
                campaign.status,
                {"flag_values": [0, 1, 2], "flag_meanings": "observed not_reached missing"},
            ),
            "covariance": (("sensor", "sensor_bis"), problem.covariance),
            "recorded_mean": ("sensor", problem.recorded_mean, {"units": "m s-1; m for the runout"}),
            "s_from": ("sensor", [s.s_from_m for s in campaign.sensors], {"units": "m"}),
            "s_to": ("sensor", [s.s_to_m for s in campaign.sensors], {"units": "m"}),
            "release_s": ("event", [e.release_s_m for e in campaign.events], {"units": "m"}),
            "track_x": ("point", campaign.track.x_m, {"units": "m"}),
            "track_z": ("point", campaign.track.z_m, {"units": "m"}),
            "cell_edge": ("edge", terrain.edge_s_m, {"units": "m"}),
            "slope": ("cell", terrain.slope_rad, {"units": "rad"}),
            "curvature": ("cell", terrain.curvature, {"units": "m-1"}),
        },
        coords={"event": problem.coords["event"], "sensor": sensor, "sensor_bis": sensor},
    )


def _storable(stats: xr.Dataset) -> xr.Dataset:
    """Statistics that netCDF can hold: SMC pads its evidence in arrays of objects."""
    kept = stats.copy()
    for name, variable in stats.data_vars.items():
        if variable.dtype == object:
            numbers = xr.apply_ufunc(_last_finite, variable, vectorize=True, output_dtypes=[float])
            kept[name] = numbers
    return kept


def _last_finite(value: Any) -> float:
    numbers = np.ravel(np.asarray(value, dtype=float))
    finite = numbers[np.isfinite(numbers)]
    return float(finite[-1]) if len(finite) else float("nan")


def _attributes(problem: PooledProblem, law: Law, gate: Gate, settings: SamplerSettings) -> dict[str, Any]:
    campaign = problem.campaign
    return {
        "title": f"{law.title}, pooled calibration on {campaign.name}",
        "law": law.id,
        "equation": law.equation,
        "campaign": campaign.name,
        "campaign_fingerprint": campaign.fingerprint(),
        "likelihood": "pooled",
        "smoothing_m": problem.terrain.smoothing_m,
        "n_cells": problem.terrain.n_cells,
        "settings": json.dumps(settings.as_dict()),
        "seed": settings.seed,
        "gate": json.dumps(gate.as_dict()),
        "versions": json.dumps({"python": platform.python_version(), **{p: version(p) for p in _PACKAGES}}),
    }
