"""Results made once: two pooled laws, a hierarchical one, a diagnosis that is made up, files of ArviZ."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

sys.path.append(str(Path(__file__).parent.parent / "report"))  # for a diagnosis that is made up quickly


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory, problem: Any) -> Path:
    """Folders `pcm` and `coulomb` (pooled), `hierarchical`, `diagnosis`."""
    from diagnosis_report_cases import write_documents

    from skred.inference.calibrate import calibrate, write_calibration
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.laws import load_law

    root = tmp_path_factory.mktemp("results")
    settings = SamplerSettings(draws=200, tune=200, chains=2, seed=1)
    hierarchical = hierarchical_problem(problem.campaign)
    for name, law, of in (
        ("pcm", "pcm", problem),
        ("coulomb", "coulomb", problem),
        ("hierarchical", "coulomb", hierarchical),
    ):
        (root / name).mkdir()
        write_calibration(calibrate(of, load_law(law), settings), root / name)
    (root / "diagnosis").mkdir()
    write_documents("segment_friction", root / "diagnosis")
    return root


@pytest.fixture(scope="session")
def given(results: Path) -> Any:
    """All of it, read."""
    from skred.dashboard.reading import read_given

    return read_given([results / name for name in ("pcm", "coulomb", "hierarchical", "diagnosis")])


@pytest.fixture
def tree_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes the groups that a test makes up as a netCDF file."""

    def write(name: str, **groups: xr.Dataset) -> Path:
        xr.DataTree.from_dict(groups).to_netcdf(tmp_path / f"{name}.nc", engine="h5netcdf")
        return tmp_path / f"{name}.nc"

    return write


@pytest.fixture
def tree_copy(tmp_path: Path) -> Callable[..., Path]:
    """Writes a netCDF file again, with groups changed by a function and with other attributes."""

    def write(file: Path, name: str = "copy", change: Any = dict, **attributes: str) -> Path:
        with xr.open_datatree(file, engine="h5netcdf") as opened:
            tree = opened.load()
        groups = {str(key): node.to_dataset() for key, node in tree.children.items()}
        copied = xr.DataTree.from_dict(change(groups))
        copied.attrs = {**tree.attrs, **attributes}
        copied.to_netcdf(tmp_path / f"{name}.nc", engine="h5netcdf")
        return tmp_path / f"{name}.nc"

    return write


@pytest.fixture
def older(results: Path, tmp_path: Path) -> Path:
    """A calibration that another version wrote."""
    folder = tmp_path / "older"
    shutil.copytree(results / "pcm", folder)
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | {"format": 99}))
    return folder


@pytest.fixture
def arviz_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a netCDF file as ArviZ does, with names of one's choice."""

    def write(name: str = "schools", text: str = "", n_parameters: int = 3) -> Path:
        rng = np.random.default_rng(3)
        events = [f"{text}{k}" for k in range(8)]
        draws, dims = (2, 100), ("chain", "draw")
        coords = {"o": events, "k": [f"{text}{k}" for k in range(n_parameters)]}
        posterior = xr.Dataset(
            {f"mu{text}": (dims, rng.normal(size=draws)),
             "theta": ((*dims, "k"), rng.normal(size=(*draws, n_parameters)))}, coords={"k": coords["k"]},
        )  # fmt: skip
        of_events = {f"y{text}": ((*dims, "o"), rng.normal(size=(*draws, 8)))}
        observed = {f"y{text}": ("o", rng.normal(size=8))}
        tree = xr.DataTree.from_dict(
            {
                "posterior": posterior,
                "prior": posterior,
                "log_likelihood": xr.Dataset(of_events, coords={"o": events}),
                "posterior_predictive": xr.Dataset(of_events, coords={"o": events}),
                "observed_data": xr.Dataset(observed, coords={"o": events}),
            }
        )
        tree.to_netcdf(tmp_path / f"{name}.nc", engine="h5netcdf")
        return tmp_path / f"{name}.nc"

    return write
