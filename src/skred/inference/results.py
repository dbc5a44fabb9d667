"""A calibration as one DataTree: named dimensions, units, diagnostics, and what is needed to repeat it."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from functools import singledispatch
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.documents import TREE_FORMAT
from skred.inference.by_sensor import joint_terms
from skred.inference.gate import Gate
from skred.inference.problem import Problem
from skred.inference.recorded_data import recorded_groups
from skred.inference.sampling import SamplerSettings
from skred.output import write_bytes
from skred.physics.law import Law, Parameter, parameter_of

FORMAT = TREE_FORMAT
"""Of the files with trees; figures are made from no other."""
_PACKAGES = ("skred", "pymc", "pytensor", "arviz", "numba", "numpy", "scipy", "xarray")


@singledispatch
def predictive(
    problem: Problem, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
) -> dict[str, xr.Dataset]:
    """Groups of a result that are a likelihood's own, from draws of the parameters.

    Each kind of problem registers its own in the module that makes its results.
    """
    raise TypeError(f"no predictive groups are registered for problems of type {type(problem).__name__}")


@singledispatch
def summary(problem: Problem, law: Law, tree: xr.DataTree) -> dict[str, Any]:
    """Plain data for a summary beside the parameters, from the whole result; registered likewise."""
    raise TypeError(f"no summary is registered for problems of type {type(problem).__name__}")


def assemble(
    problem: Problem,
    law: Law,
    posterior: xr.DataTree,
    prior: xr.Dataset,
    gate: Gate,
    settings: SamplerSettings,
) -> xr.DataTree:
    """Gather posterior, sample_stats, log_likelihood, predictive, prior, observed and constant data.

    Groups
    ------
    posterior, prior : parameters of the law, and of the population in a hierarchical calibration
    posterior_predictive : readings of new avalanches from the recorded releases, by sensor
    log_likelihood : ``recordings`` (chain, draw, event), and what `skred.inference.by_sensor` adds
    new_avalanches, mean_response, event_posterior, prior_predictive : see `predictive`
    observed_data, constant_data : see `skred.inference.recorded_data.recorded_groups`
    """
    parameters = posterior["posterior"].to_dataset()
    own = problem.parameters(law)
    samples = {parameter.name: parameters[parameter.name].values.ravel() for parameter in own}
    log_density = problem.log_likelihood(law, samples)
    sizes = (parameters.sizes["chain"], parameters.sizes["draw"])
    groups = {
        "posterior": _with_units(parameters, own, law),
        "log_likelihood": joint_terms(problem, log_density.reshape(*sizes, -1), chain_and_draw(parameters)),
        "prior": _with_units(prior, own, law),
        **predictive(problem, law, parameters, prior, settings.seed),
        **recorded_groups(problem),
    }
    if "sample_stats" in posterior.children:
        groups["sample_stats"] = _storable(posterior["sample_stats"].to_dataset())
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = _attributes(problem, law, gate, settings)
    return tree


def chain_and_draw(dataset: xr.Dataset) -> dict[str, Any]:
    """Coordinates of the draws."""
    return {"chain": dataset["chain"].values, "draw": dataset["draw"].values}


def draws_by_name(problem: Problem, law: Law, draws: xr.Dataset) -> dict[str, FloatArray]:
    """Draws of all parameters of a law on a problem, chain after chain, (n,) each."""
    names = [parameter.name for parameter in problem.parameters(law)]
    return {name: draws[name].transpose("chain", "draw").values.ravel() for name in names}


def save(tree: xr.DataTree, file: Path) -> None:
    """Write a tree as netCDF, whole or not at all.

    By way of memory: where the disk is full, HDF5 ends the whole process instead of raising an error.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = tree.to_netcdf(engine="h5netcdf")
    assert isinstance(content, memoryview)
    write_bytes(file, content)


def _with_units(parameters: xr.Dataset, own: Sequence[Parameter], law: Law) -> xr.Dataset:
    labelled = parameters.copy()
    for parameter in (*own, *law.derived):
        if parameter.name not in labelled:
            continue  # the prior holds the free variables only
        labelled[parameter.name].attrs.update(units=parameter.unit, symbol=parameter.symbol)
    return labelled


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


def _attributes(problem: Problem, law: Law, gate: Gate, settings: SamplerSettings) -> dict[str, Any]:
    campaign = problem.campaign
    return {
        **law_attributes(problem, law),
        "campaign": campaign.name,
        "campaign_fingerprint": campaign.fingerprint(),
        "smoothing_m": problem.terrain.smoothing_m,
        "n_cells": problem.terrain.n_cells,
        "settings": json.dumps(settings.as_dict()),
        "seed": settings.seed,
        "gate": json.dumps(gate.as_dict()),
        "versions": json.dumps({"python": platform.python_version(), **{p: version(p) for p in _PACKAGES}}),
    }


def law_attributes(problem: Problem, law: Law) -> dict[str, Any]:
    """Names, symbols and units of a calibrated law, as attributes of its tree: figures know of no other."""
    others = [parameter for parameter in problem.parameters(law) if parameter not in law.parameters]
    return {
        "format": FORMAT,
        "title": f"{law.title}, {problem.likelihood} calibration on {problem.campaign.name}",
        "law": law.id,
        "law_title": law.title,
        "law_parameters": _json(law.parameters),
        "population_parameters": _json(others),
        "strengths": _json([parameter_of(mechanism.strength) for mechanism in law.mechanisms]),
        "equation": law.equation,
        "likelihood": problem.likelihood,
        "changed_priors": json.dumps(dict(law.changed_priors)),
    }


def _json(parameters: Sequence[Parameter]) -> str:
    return json.dumps([asdict(parameter) for parameter in parameters])
