"""A second attempt where the gate failed: longer chains, or events resolved finer."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import cloudpickle
import numpy as np
import pytest
import xarray as xr

from skred.campaign import find_campaign, read_campaign
from skred.campaign.parts import of_events
from skred.inference.calibrate import LONGER, MORE, calibrate_surely
from skred.inference.hierarchical.problem import COARSER, HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law

LAW = load_law("constant")


def problem() -> HierarchicalProblem:
    return hierarchical_problem(of_events(read_campaign(find_campaign("ryggfonn")), range(8)))


def test_enough_the_first_time() -> None:
    given, settings = problem(), SamplerSettings(draws=600, tune=400, seed=1)
    found = calibrate_surely(given, LAW, settings)
    assert found.gate.passed and found.settings == settings and found.problem is given
    # To another process, and back from there, without what is compiled.
    copied = pickle.loads(cloudpickle.dumps(found))
    assert {"model", "step"} <= vars(found).keys() and not {"model", "step"} & vars(copied).keys()
    assert copied.tree["posterior"].to_dataset().equals(found.tree["posterior"].to_dataset())
    assert copied.model.initial_point().keys() == found.model.initial_point().keys()


def test_coarser_surfaces_cost_less_and_are_nearly_as_good() -> None:
    """What a diagnosis calibrates with; where it does not do it is made finer step by step."""
    law, campaign = load_law("pcm"), read_campaign(find_campaign("ryggfonn"))
    usual = hierarchical_problem(campaign)
    coarser: Any = replace(usual, fineness=COARSER)
    runs = [one.surfaces(law.mechanisms).n_runs for one in (usual, coarser)]
    assert runs[1] < 0.95 * runs[0]
    samples = {
        "dry_friction": np.array([0.3, 0.28]),
        "turbulent_drag": np.array([2e-3, 1e-3]),
        "dry_friction_spread": np.array([0.1, 0.2]),
        "turbulent_drag_spread": np.array([0.3, 1.0]),
        "dry_friction_turbulent_drag_correlation": np.array([-0.3, 0.3]),
    }
    errors = coarser.integration_errors(law, samples)
    assert 1e-6 < 22.0 * np.abs(errors.mean(axis=1)).max() < 0.2
    assert [coarser.finer(law, xr.Dataset()).fineness, usual.finer(law, xr.Dataset()).fineness] == [1.0, 2.0]


@pytest.mark.parametrize(("draws", "times"), [(60, MORE), (5, MORE**LONGER)])
def test_short_chains_are_made_longer(draws: int, times: int) -> None:
    """Twice at most: five draws are too few even so."""
    given = problem()
    found = calibrate_surely(given, LAW, SamplerSettings(draws=draws, tune=100, seed=1))
    assert found.gate.passed == (draws > 5)
    assert (found.settings.draws, found.settings.tune) == (times * draws, times * 100)
    assert found.problem is given


def test_a_rough_integration_is_made_finer() -> None:
    """The limit lies between the errors of both."""
    given, settings = problem(), SamplerSettings(draws=600, tune=400, seed=1)
    samples = {"retardation": np.array([4.0, 5.0]), "retardation_spread": np.array([0.15, 0.3])}
    finer: Any = given.finer(LAW, xr.Dataset())
    rough, fine = (np.abs(one.integration_errors(LAW, samples)).max() for one in (given, finer))
    assert fine < 0.5 * rough
    found = calibrate_surely(replace(given, integration_limit=1e-7), LAW, settings)
    assert isinstance(found.problem, HierarchicalProblem) and found.problem.fineness == 2
    assert found.problem.finer(LAW, xr.Dataset()) is None
    assert "integration" in found.gate.problems[0]
