"""Calibrations made up, as folders that a prediction can start from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from skred.inference.added_terms import GROUP, AddedTerm, added_group
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.recorded_data import recorded_groups
from skred.inference.results import FORMAT, save
from skred.output import write_json
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import Setting, Shape

N_CHAINS, N_DRAWS = 2, 40
CENTRES = {
    "coulomb": {"dry_friction": (0.45, 0.05), "dry_friction_spread": (0.12, 0.15)},
    "pcm": {
        "dry_friction": (0.45, 0.05),
        "turbulent_drag": (0.003, 1e-6),
        "dry_friction_spread": (0.12, 0.15),
        "turbulent_drag_spread": (1e-6, 1e-6),
        "dry_friction_turbulent_drag_correlation": (1e-6, 1e-6),
    },
}
"""Median and log standard deviation of each parameter."""


def tree_of(
    problem: HierarchicalProblem,
    law_id: str,
    terms: Sequence[AddedTerm] = (),
    strengths: Sequence[float] = (),
) -> xr.DataTree:
    """A posterior made up, with all that is written beside it; what is added has the same strength always."""
    rng = np.random.default_rng(5)
    shape = (N_CHAINS, N_DRAWS)
    draws = {
        name: (("chain", "draw"), median * np.exp(sd * rng.standard_normal(shape)))
        for name, (median, sd) in CENTRES[law_id].items()
    }
    added = {
        term.name: (("chain", "draw"), np.full(shape, value))
        for term, value in zip(terms, strengths, strict=True)
    }
    posterior = xr.Dataset(draws | added, coords={"chain": range(N_CHAINS), "draw": range(N_DRAWS)})
    groups = {"posterior": posterior, **recorded_groups(problem)}
    if terms:
        groups[GROUP] = added_group(terms)
    tree = xr.DataTree.from_dict(groups)
    passed = {
        "passed": True,
        "r_hat_max": 1.001,
        "ess_bulk_min": 900.0,
        "ess_tail_min": 800.0,
        "divergences": 0,
    }
    tree.attrs = {
        "format": FORMAT,
        "law": law_id,
        "equation": load_law(law_id).equation,
        "likelihood": "hierarchical",
        "campaign": problem.campaign.name,
        "campaign_fingerprint": problem.campaign.fingerprint(),
        "smoothing_m": problem.terrain.smoothing_m,
        "settings": "{}",
        "seed": 3,
        "gate": json.dumps({**passed, "problems": []}),
        "versions": json.dumps({"skred": "0"}),
    }
    return tree


def term_of(
    problem: HierarchicalProblem, law_id: str, mechanism_id: str, shape: Shape | None = None
) -> AddedTerm:
    """A mechanism of the library, as a diagnosis would add it."""
    shape = Shape() if shape is None else shape
    mechanism, n_cells = mechanisms()[mechanism_id], problem.terrain.n_cells
    assert mechanism.added is not None
    base = tuple(one.id for one in load_law(law_id).mechanisms)
    sensors = tuple(problem.campaign.sensor_ids)
    velocities = tuple(not sensor.is_runout for sensor in problem.campaign.sensors)
    n_events, length = problem.campaign.n_events, problem.terrain.length_m
    covariates = {"made_up": np.linspace(-1.0, 1.0, n_events)}
    speed = np.zeros(n_cells + 1)
    setting = Setting(problem.terrain, base, (0.0, length), sensors, velocities, covariates, n_events, speed)
    direction = direction_of(mechanism, setting, shape)
    name, bound_to = mechanism.strength.name, mechanism.added.bound_to
    return AddedTerm(name, mechanism_id, mechanism.title, mechanism.group, bound_to, shape, direction)


def folder_of(
    folder: Path, tree: xr.DataTree, document: str = "summary.json", file: str = "posterior.nc"
) -> Path:
    """A folder as `skred calibrate` writes it, or with another document that of another command."""
    folder.mkdir(exist_ok=True)
    save(tree, folder / file)
    write_json(folder / document, {"format": 1, "verdict": "missing_physics"})
    return folder


def plane(folder: Path, degrees: float = 32.0, length_m: float = 1200.0) -> Path:
    """A track that is an inclined plane."""
    x = np.linspace(0.0, length_m * np.cos(np.radians(degrees)), 201)
    z = 1000.0 - np.tan(np.radians(degrees)) * x
    file = folder / "plane.csv"
    rows = [f"{a:.6f},{b:.6f}" for a, b in zip(x, z, strict=True)]
    file.write_text("\n".join(["x_m,z_m", *rows]) + "\n")
    return file


def many_gates(folder: Path, n: int) -> Path:
    """A campaign of three avalanches on a plane with gates every 40 m, the lowest one first in its file."""
    folder.mkdir()
    names = [f"gate{k}" for k in range(n)]
    head = 'format = 1\nname = "gates"\ndescription = ""\nsource = ""\norigin = "simulated"\n'
    (folder / "campaign.toml").write_text(f"{head}reference_s_m = 50.0\n")
    plane(folder, length_m=40.0 * n + 300.0).rename(folder / "track.csv")
    rows = [f"{name},front_velocity,{40 * k + 40},{40 * k + 40},0.1,1\n" for k, name in enumerate(names)]
    title = "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\n"
    (folder / "sensors.csv").write_text(title + "".join(reversed(rows)))
    (folder / "events.csv").write_text("event,release_s_m\na,0\nb,0\nc,0\n")
    passed = [f"{event},{name},{10 + k % 5},observed\n" for event in "abc" for k, name in enumerate(names)]
    (folder / "recordings.csv").write_text("event,sensor,value,status\n" + "".join(passed))
    return folder
