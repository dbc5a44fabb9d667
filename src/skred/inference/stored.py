"""A hierarchical calibration read again from its netCDF file: without its campaign, and without sampling."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from skred.campaign import Campaign, Event, Sensor, Status, Track
from skred.documents import AGAIN, opened_tree
from skred.errors import InputError
from skred.inference.added_terms import AddedTerm, added_terms
from skred.inference.calibrate import Calibration
from skred.inference.error_model import ERROR_MODELS
from skred.inference.gate import Gate
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.priors import laws_with_priors
from skred.inference.sampling import SamplerSettings
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.terrain import Terrain, build_terrain


@dataclass(frozen=True, eq=False)
class Stored:
    """A calibration that was read from a file.

    Attributes
    ----------
    calibration : Calibration
        Its campaign has what was recorded, without description and covariates, and so another fingerprint:
        the right one is an attribute of the tree.
    problem : HierarchicalProblem
        That of the calibration.
    added : tuple of AddedTerm
        What was added to the law, if anything was.
    """

    calibration: Calibration
    problem: HierarchicalProblem
    added: tuple[AddedTerm, ...]


def read_stored(file: Path) -> Stored:
    """Read a hierarchical calibration.

    Raises
    ------
    InputError
        If it is not there, not netCDF, of another version, or not hierarchical.
    """
    with opened_tree(file) as opened:
        tree = opened.load()
    if tree.attrs.get("likelihood", "hierarchical") != "hierarchical":
        raise InputError(
            f"{file}: calibrated with --likelihood {tree.attrs['likelihood']}, which has no population to"
            " draw avalanches from; calibrate with --likelihood hierarchical"
        )
    try:
        return _stored(tree)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        lacks = f"{type(error).__name__}: {error}"
        raise InputError(
            f"{file}: lacks what a prediction needs ({lacks:.80}): of an older version? Then {AGAIN}"
        ) from error


def _stored(tree: xr.DataTree) -> Stored:
    attributes = tree.attrs
    law = load_law(str(attributes["law"]))
    _check_equation(law, attributes)
    changed = json.loads(str(attributes.get("changed_priors", "{}")))
    [law] = laws_with_priors(
        [law], {name: scale for name, scale in changed.items() if name in law.parameter_names}
    )
    campaign = _campaign(tree)
    constant = tree["constant_data"].to_dataset()
    terrain = _terrain(campaign.track, constant, float(attributes["smoothing_m"]))
    name = str(attributes.get("error_model", constant["error_model"].item()))
    problem = HierarchicalProblem(campaign, terrain, ERROR_MODELS[name])
    held = json.loads(attributes["gate"])
    keys = ("r_hat_max", "ess_bulk_min", "ess_tail_min", "divergences")
    gate = Gate(**{key: held[key] for key in keys}, problems=tuple(held["problems"]))
    settings = SamplerSettings(**json.loads(attributes["settings"]))
    return Stored(Calibration(law, problem, settings, tree, gate), problem, added_terms(tree))


def _check_equation(law: Law, attributes: Any) -> None:
    """Refuse draws of a law that has meanwhile another equation."""
    stored = attributes.get("equation", law.equation)
    if stored != law.equation:
        raise InputError(
            f"the law {law.id} has another equation now ({law.equation}) than in the folder ({stored});"
            f" {AGAIN}"
        )


def _terrain(track: Track, constant: xr.Dataset, smoothing_m: float) -> Terrain:
    """The terrain of the calibration: made anew where that gives the same cells, else as it was stored."""
    edge = np.asarray(constant["cell_edge"].values, dtype=float)
    if np.isfinite(smoothing_m):
        terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m).continued_up(float(edge[0]))
        if terrain.edge_s_m.shape == edge.shape and np.allclose(terrain.edge_s_m, edge):
            return terrain
    slope = np.asarray(constant["slope"].values, dtype=float)
    return Terrain(edge, np.sin(slope), np.cos(slope), constant["curvature"].values, smoothing_m)


def _campaign(tree: xr.DataTree) -> Campaign:
    """What was recorded, from the groups of `skred.inference.recorded_data`."""
    constant = tree["constant_data"].to_dataset()
    shape = constant["reading"].shape
    nothing = np.full(shape, np.nan)
    status = constant["status"].values
    least, most = (
        constant[name].values if name in constant else nothing for name in ("reading_least", "reading_most")
    )
    values = np.where(np.isin(status, (Status.AT_LEAST, Status.BETWEEN)), least, constant["reading"].values)
    values = np.where(status == Status.AT_MOST, most, values)
    reference = constant.attrs.get("reference_s")
    return Campaign(
        name=str(tree.attrs["campaign"]),
        description="",
        source="",
        origin="measured",
        reference_s_m=None if reference is None else float(reference),
        track=Track(constant["track_x"].values, constant["track_z"].values),
        sensors=_sensors(constant),
        events=_events(constant),
        values=values,
        status=status,
        stated_sd=constant["stated_sd"].values,
        values_to=np.where(status == Status.BETWEEN, most, np.nan),
    )


def _sensors(constant: xr.Dataset) -> tuple[Sensor, ...]:
    keys = ("s_from", "s_to", "relative_sd", "absolute_sd", "place_sd")
    numbers = np.column_stack([constant[key].values for key in keys]).tolist()
    quantities = [str(quantity) for quantity in constant["quantity"].values]
    return tuple(
        Sensor(
            str(name),
            "runout" if quantity == "runout" else "front_velocity",
            s_from,
            s_to,
            relative,
            absolute,
            _known(place),
        )
        for name, quantity, (s_from, s_to, relative, absolute, place) in zip(
            constant["sensor"].values, quantities, numbers, strict=True
        )
    )


def _events(constant: xr.Dataset) -> tuple[Event, ...]:
    keys = ("release_s", "release_sd", "release_speed", "release_speed_sd")
    numbers = np.column_stack([constant[key].values for key in keys]).tolist()
    return tuple(
        Event(str(name), place, sd or None, {}, speed or None, speed_sd or None)
        for name, (place, sd, speed, speed_sd) in zip(constant["event"].values, numbers, strict=True)
    )


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value
