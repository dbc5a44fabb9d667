"""A hierarchical calibration as one tree, and what its summary says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from skred.inference.calibrate import Calibration, calibrate
from skred.inference.hierarchical.problem import INTEGRATION_LIMIT, HierarchicalProblem, hierarchical_problem
from skred.inference.hierarchical.results import MOST_AVALANCHES
from skred.inference.results import predictive, save
from skred.inference.sampling import SamplerSettings
from skred.output import plain
from skred.physics.laws import load_law


@pytest.fixture(scope="module")
def calibrated(problem: Any) -> Calibration:
    hierarchical = hierarchical_problem(problem.campaign)
    return calibrate(hierarchical, load_law("constant"), SamplerSettings(draws=500, tune=500, seed=2))


def test_the_gate_is_passed_and_the_integration_checked(calibrated: Calibration) -> None:
    assert calibrated.gate.passed, calibrated.gate.problems
    integration = calibrated.entry()["integration"]
    assert 0.0 < integration["largest_mean_error"] < INTEGRATION_LIMIT
    assert integration["checked_events"] == 22


class Wrong(HierarchicalProblem):
    """With an integration over events that is wrong by 0.02 nats."""

    def integration_errors(self, law: Any, samples: Any, seed: int = 0) -> Any:
        return np.full((3, 22), 0.02)


def test_a_wrong_integration_fails_the_gate(calibrated: Calibration) -> None:
    posterior = calibrated.tree["posterior"].to_dataset()
    wrong = Wrong(calibrated.problem.campaign, calibrated.problem.terrain)
    [problem] = wrong.numerical_problems(calibrated.law, posterior)
    assert "wrong by 0.02 nats per event" in problem
    assert not calibrated.gate.with_numerical_problems([problem]).passed


def test_the_tree_holds_everything_and_comes_back(calibrated: Calibration, tmp_path: Path) -> None:
    file = tmp_path / "posterior.nc"
    save(calibrated.tree, file)
    with xr.open_datatree(file, engine="h5netcdf") as tree:
        assert tree.attrs["likelihood"] == "hierarchical"
        assert tree["posterior"].to_dataset()["retardation_spread"].attrs["units"] == "1"
        events = tree["event_posterior"].to_dataset()
        assert events["retardation"].dims == ("chain", "draw", "event")
        assert events["retardation"].attrs["units"] == "m s-2"
        new = tree["new_avalanches"].to_dataset()
        assert new["reading"].dims == ("chain", "draw", "event", "sensor")
        assert new["reached"].dtype == bool
        assert tree["log_likelihood"].to_dataset()["recordings"].sizes["event"] == 22
        assert json.loads(tree.attrs["gate"])["passed"]


def test_log_likelihood_is_that_of_the_model(calibrated: Calibration) -> None:
    """The stored terms against the model's own, at one draw."""
    model, posterior = calibrated.model, calibrated.tree["posterior"].to_dataset().isel(chain=1, draw=7)
    point = model.initial_point()
    for name in ("retardation", "retardation_spread"):
        point[f"{name}_log__"] = np.log(float(posterior[name]))
    terms = model.compile_fn(model.logp(vars=model["recordings"], sum=False))(point)
    stored = calibrated.tree["log_likelihood"].to_dataset()["recordings"].isel(chain=1, draw=7)
    np.testing.assert_allclose(np.ravel(terms), stored.values, rtol=1e-9)


def test_the_summary_sets_the_next_avalanche_beside_the_recorded(calibrated: Calibration) -> None:
    entry = plain(calibrated.entry())
    assert [p["name"] for p in entry["parameters"]] == ["retardation", "retardation_spread"]
    b = entry["new_avalanche"][2]
    assert b["sensor"] == "b" and b["n_recorded"] == 15
    assert b["recorded_reached"] == pytest.approx(12 / 21) and 0.0 < b["reached"] < 1.0
    assert b["low"] < b["mean"] < b["high"]
    fast = next(row for row in entry["events"] if row["event"] == "20000217")["retardation"]
    slow = next(row for row in entry["events"] if row["event"] == "20030406")["retardation"]
    assert fast["low"] < fast["median"] < fast["high"] < slow["median"]


def test_many_draws_are_thinned(calibrated: Calibration) -> None:
    """Ten times the posterior's, of 22 avalanches."""
    tree = calibrated.tree
    posterior, prior = tree["posterior"].to_dataset(), tree["prior"].to_dataset()
    many = xr.concat([posterior] * 10, "draw").assign_coords(draw=np.arange(5000))
    groups = predictive(calibrated.problem, calibrated.law, many, prior, 0)
    for name in ("event_posterior", "new_avalanches", "posterior_predictive"):
        draws = groups[name]["draw"].values
        assert draws[1] == 3 and len(draws) * 4 * 22 <= MOST_AVALANCHES < 2 * len(draws) * 4 * 22
    assert groups["prior_predictive"].sizes["draw"] == prior.sizes["draw"]
