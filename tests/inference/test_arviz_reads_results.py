"""ArviZ's comparisons and predictive checks take the file of a calibration as it is."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import arviz as az
import arviz_plots as azp
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import halfnorm

from skred.campaign import Status
from skred.inference.by_sensor import observed_by_sensor, sensors_with_readings
from skred.inference.calibrate import calibrate, write_calibration
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law

SENSORS = ["LC", "CD", "b", "runout"]
PREDICTIVE = {
    "dist": azp.plot_ppc_dist,
    "pit": azp.plot_ppc_pit,
    "loo_pit": azp.plot_loo_pit,
}


@pytest.fixture(scope="module", autouse=True)
def without_a_display() -> Iterator[None]:
    before = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield
    plt.close("all")
    matplotlib.use(before)


@pytest.fixture(scope="module", params=["pooled", "hierarchical"])
def results(request: pytest.FixtureRequest, calibration: Any, tmp_path_factory: Any) -> Any:
    """A calibration of each kind, as it comes back from its file."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    if request.param == "hierarchical":
        problem = hierarchical_problem(calibration.problem.campaign)
        calibration = calibrate(problem, load_law("pcm"), SamplerSettings(draws=500, tune=500, seed=1))
    write_calibration(calibration, folder)
    with xr.open_datatree(folder / "posterior.nc", engine="h5netcdf") as tree:
        yield tree.load(), calibration


def test_predictive_groups_hold_readings_by_sensor_and_nothing_else(results: Any) -> None:
    tree, calibration = results
    campaign = calibration.problem.campaign
    for group in ("posterior_predictive", "prior_predictive", "observed_data"):
        assert list(tree[group].data_vars) == SENSORS
    for column, name in enumerate(SENSORS):
        observed, predicted = tree["observed_data"][name], tree["posterior_predictive"][name]
        known = campaign.status[:, column] != Status.MISSING
        assert_array_equal(observed[f"event_{name}"].values, np.array(campaign.event_ids)[known])
        recorded = np.where(campaign.status == Status.NOT_REACHED, 0.0, campaign.values)[known, column]
        assert_array_equal(observed.values, recorded)
        assert predicted.dims == ("chain", "draw", *observed.dims)
        assert observed.attrs == {"units": "m" if name == "runout" else "m s-1", "long_name": name}
        assert np.isfinite(predicted.values).all() and (name == "runout" or predicted.values.min() == 0.0)


def test_an_avalanche_is_left_out_as_a_whole(results: Any) -> None:
    """LOO-PIT of a reading: the share of smaller ones, weighted by the event's inverse likelihood."""
    tree, _ = results
    group = tree["log_likelihood"]
    assert list(group.data_vars) == ["recordings"]
    term = group["b"].sel(event_b="20000217")
    assert_array_equal(term.values, group["recordings"].sel(event="20000217").values)
    weight = np.exp(-(term - term.max()).values + 0.0)
    smaller = (tree["posterior_predictive"]["b"] <= tree["observed_data"]["b"]).sel(event_b="20000217").values
    found = float(az.loo_pit(tree)["b"].sel(event_b="20000217"))
    assert_allclose(found, (weight * smaller).sum() / weight.sum(), atol=0.05)


def test_comparisons_need_no_names(results: Any) -> None:
    tree, calibration = results
    loo = az.loo(tree)
    assert loo.n_data_points == 22 and loo.elpd == az.loo(calibration.tree, var_name="recordings").elpd
    table = az.compare({"one": tree, "same": tree})
    assert table["elpd_diff"].tolist() == [0.0, 0.0]
    points = azp.plot_khat(az.loo(tree, pointwise=True)).viz["khat"]
    assert len(points) == 1


def test_the_sensitivity_to_priors_needs_no_more(results: Any) -> None:
    tree, calibration = results
    names = [parameter.name for parameter in calibration.problem.parameters(calibration.law)]
    assert set(tree["log_prior"].data_vars) == set(names)
    scale = calibration.law.mechanisms[0].strength.prior_scale
    if calibration.problem.likelihood == "pooled":
        draws = tree["posterior"]["dry_friction"].values
        assert_allclose(tree["log_prior"]["dry_friction"], halfnorm(scale=scale).logpdf(draws))
    table = az.psense_summary(tree)
    assert set(table.index) == set(names) and np.isfinite(table["prior"].astype(float)).all()


def test_a_sensors_name_asks_for_the_joint_terms_of_its_avalanches(results: Any) -> None:
    tree, _ = results
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Estimated shape parameter")
        named, all_of_them = (az.loo(tree, var_name=name, pointwise=True) for name in ("b", "recordings"))
    theirs = all_of_them.elpd_i.sel(event=named.elpd_i["event_b"].values)
    assert_allclose(named.elpd_i.values, theirs.values, rtol=1e-3)


def test_measures_of_a_sensor_need_the_terms_as_variables(results: Any) -> None:
    """As the page of the Python surface has it; without that ArviZ asks for 134 GiB."""
    by_sensor = results[0].copy()
    log_likelihood = by_sensor["log_likelihood"].to_dataset().reset_coords(SENSORS)
    by_sensor["log_likelihood"] = xr.DataTree(log_likelihood)
    assert 0.0 < az.loo_metrics(by_sensor, kind="rmse", var_name="b").mean < 30.0
    assert az.loo_r2(by_sensor, var_name="b").mean < 1.0
    expected, _ = az.loo_expectations(by_sensor, var_name="b")
    assert expected.dims == ("event_b",)
    assert list(results[0]["log_likelihood"].data_vars) == ["recordings"]


@pytest.mark.parametrize("plot", PREDICTIVE)
def test_predictive_checks_draw_every_sensor(plot: str, results: Any) -> None:
    tree, _ = results
    collection = PREDICTIVE[plot](tree)
    assert set(map(str, collection.viz["plot"].data_vars)) == set(SENSORS)
    plt.close("all")
    PREDICTIVE[plot](tree, var_names="b")
    plt.close("all")


def test_names_of_sensors_are_made_safe_and_kept_apart(problem: Any) -> None:
    """A blank as well: xarray writes no coordinates with one, and such terms would come back as variables."""
    ids = ("event", "a b", "a:b", "/")
    sensors = tuple(replace(s, id=name) for s, name in zip(problem.campaign.sensors, ids, strict=True))
    status = problem.campaign.status.copy()
    status[:, 0] = Status.MISSING
    changed = replace(problem, campaign=replace(problem.campaign, sensors=sensors, status=status))
    found = sensors_with_readings(changed)
    assert [one.name for one in found] == ["a_b", "a_b_", "_"]
    assert [one.attributes["long_name"] for one in found] == list(ids[1:])
    assert set(observed_by_sensor(changed).data_vars) == {"a_b", "a_b_", "_"}
