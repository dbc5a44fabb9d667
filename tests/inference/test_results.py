"""The tree of a calibration: what is in it, in which units, and that plain tools read it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np
import pymc as pm
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

from skred.inference.calibrate import calibrate
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law

GROUPS = {
    "posterior",
    "sample_stats",
    "log_likelihood",
    "posterior_predictive",
    "mean_response",
    "new_avalanches",
    "prior",
    "prior_predictive",
    "observed_data",
    "constant_data",
}
ATTRIBUTES = {
    "title",
    "law",
    "equation",
    "campaign",
    "campaign_fingerprint",
    "likelihood",
    "smoothing_m",
    "n_cells",
    "settings",
    "seed",
    "gate",
    "versions",
}


@pytest.fixture(scope="module")
def smc(problem: Any) -> Any:
    return calibrate(problem, load_law("constant"), SamplerSettings("smc", draws=500, chains=2, seed=1))


@pytest.fixture(scope="module")
def stored(calibration: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("stored") / "posterior.nc"
    save(calibration.tree, file)
    return file


def test_groups_and_attributes(calibration: Any, problem: Any) -> None:
    tree = calibration.tree
    assert set(tree.children) == GROUPS
    assert ATTRIBUTES <= set(tree.attrs)
    assert tree.attrs["campaign_fingerprint"] == problem.campaign.fingerprint()
    assert json.loads(tree.attrs["settings"]) == calibration.settings.as_dict()
    assert json.loads(tree.attrs["gate"])["passed"] is True
    assert json.loads(tree.attrs["versions"])["pymc"] == pm.__version__


def test_no_dim_has_a_variables_name(calibration: Any) -> None:
    for group in calibration.tree.children.values():
        dataset = group.to_dataset()
        assert not set(map(str, dataset.dims)) & set(map(str, dataset.data_vars)), group.path
        for name in dataset.data_vars:
            unnamed = [
                dim for dim in dataset[name].dims if str(dim).startswith("dim_") or "_dim_" in str(dim)
            ]
            assert not unnamed, (group.path, name, unnamed)


@pytest.mark.parametrize("group", ["posterior", "prior"])
def test_parameters_have_units(group: str, calibration: Any) -> None:
    dataset = calibration.tree[group].to_dataset()
    assert set(dataset.data_vars) == {"dry_friction", "turbulent_drag"}
    assert dataset["dry_friction"].attrs["units"] == "1"
    assert dataset["turbulent_drag"].attrs["units"] == "m-1"
    assert dataset["turbulent_drag"].attrs["symbol"] == "D"


def test_shapes(calibration: Any, problem: Any) -> None:
    tree, n_draws = calibration.tree, {"chain": 4, "draw": 1000}
    events = {"event": 22, "sensor": 4}
    assert dict(tree["new_avalanches"]["reading"].sizes) == {**n_draws, **events}
    assert dict(tree["mean_response"]["response"].sizes) == {**n_draws, "release": 1, "sensor": 4}
    assert dict(tree["log_likelihood"]["recordings"].sizes) == {**n_draws, "event": 22}
    assert dict(tree["constant_data"]["reading"].sizes) == events
    assert tree["log_likelihood"]["event"].values.tolist() == list(problem.campaign.event_ids)
    assert_array_equal(tree["constant_data"]["reading"].values, problem.values)


def test_log_likelihood_is_pymcs(calibration: Any) -> None:
    few = xr.DataTree.from_dict(
        {"posterior": calibration.tree["posterior"].to_dataset().isel(draw=slice(20))}
    )
    theirs = pm.compute_log_likelihood(
        few, model=calibration.model, extend_inferencedata=False, progressbar=False
    )
    ours = calibration.tree["log_likelihood"]["recordings"].isel(draw=slice(20))
    found = theirs["recordings"] if isinstance(theirs, xr.Dataset) else theirs["log_likelihood"]["recordings"]
    assert_allclose(ours.values, found.transpose(*ours.dims).values, rtol=1e-9)


def test_predictive_readings_scatter_about_the_response_by_sigma(calibration: Any, problem: Any) -> None:
    reading, response = (
        calibration.tree["new_avalanches"]["reading"],
        calibration.tree["mean_response"]["response"],
    )
    residual = (reading - response.isel(release=0)).values.reshape(-1, 4)
    sd = np.sqrt(np.diag(problem.covariance))
    assert np.abs(residual.mean(axis=0) / sd).max() < 0.02
    assert np.abs((np.cov(residual.T) - problem.covariance) / np.outer(sd, sd)).max() < 0.02


def test_response_of_several_releases(two_releases: Any, calibration: Any) -> None:
    from skred.inference.results import assemble

    law = calibration.law
    posterior = xr.DataTree.from_dict(
        {"posterior": calibration.tree["posterior"].to_dataset().isel(draw=slice(5))}
    )
    prior = calibration.tree["prior"].to_dataset().isel(draw=slice(5))
    tree = assemble(two_releases, law, posterior, prior, calibration.gate, calibration.settings)
    response = tree["mean_response"]["response"]
    assert response["release"].values.tolist() == [0.0, 700.0]
    rows = law.strength_rows({n: posterior["posterior"][n].values.ravel() for n in law.parameter_names})
    expected = two_releases.simulate(law.mechanisms, rows)[:, [0, 1]]
    assert_allclose(response.values.reshape(-1, 2, 4), expected, rtol=1e-12)
    assert "sample_stats" not in tree.children


def test_plain_xarray_and_arviz_read_it(stored: Path, calibration: Any) -> None:
    with xr.open_datatree(stored, engine="h5netcdf") as tree:
        assert set(tree.children) == GROUPS
        xr.testing.assert_identical(tree.load(), xr.open_datatree(stored).load())
        for path in ("posterior", "log_likelihood", "observed_data", "constant_data"):
            xr.testing.assert_equal(tree[path].to_dataset(), calibration.tree[path].to_dataset())
        assert tree["posterior"]["turbulent_drag"].attrs["units"] == "m-1"
        assert tree.attrs["campaign_fingerprint"] == calibration.tree.attrs["campaign_fingerprint"]
        summary = az.summary(tree)
        assert set(summary.index) == {"dry_friction", "turbulent_drag"}
        from_file = az.loo(tree, var_name="recordings")
    assert from_file.elpd == pytest.approx(az.loo(calibration.tree, var_name="recordings").elpd)
    assert np.isfinite(from_file.elpd)


FULL_DISK = """
import resource, sys
from pathlib import Path
import numpy as np
import xarray as xr
from skred.inference.results import save

file = Path(sys.argv[1])
save(xr.DataTree(xr.Dataset({"x": 1.0})), file)
before = file.read_bytes()
# A limit of the process stands for the end of the disk: both end a write, and HDF5 with it.
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    save(xr.DataTree(xr.Dataset({"x": ("n", np.random.default_rng(0).normal(size=200_000))})), file)
except OSError:
    assert file.read_bytes() == before
    print("told")
"""


def test_a_full_disk_is_an_error_and_leaves_nothing_half_written(tmp_path: Path) -> None:
    """In a process of its own: HDF5 would end it."""
    file = tmp_path / "posterior.nc"
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(file)], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout) == (0, "told\n"), done.stderr
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.slow
def test_statistics_of_smc_can_be_stored(
    smc: Any, tmp_path: Path, quadrature_of: Callable[[str], Any]
) -> None:
    stats = smc.tree["sample_stats"].to_dataset()
    assert all(variable.dtype != object for variable in stats.data_vars.values())
    save(smc.tree, tmp_path / "smc.nc")
    with xr.open_datatree(tmp_path / "smc.nc", engine="h5netcdf") as tree:
        evidence = tree["sample_stats"]["log_marginal_likelihood"].values
    last = [chain[np.isfinite(chain)][-1] for chain in evidence.reshape(2, -1)]
    assert_allclose(last, quadrature_of("constant").log_evidence, atol=0.4)


def test_posterior_of_smc_is_that_of_the_grid(smc: Any, quadrature_of: Callable[[str], Any]) -> None:
    grid = quadrature_of("constant")
    draws = smc.tree["posterior"]["retardation"].values
    assert abs(draws.mean() - grid.mean[0]) < 0.3 * grid.sd[0]
    assert 0.8 < draws.std() / grid.sd[0] < 1.2
