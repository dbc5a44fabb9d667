"""A second attempt where the gate failed: longer chains, or events resolved finer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from skred.campaign import find_campaign, read_campaign
from skred.campaign.parts import of_events
from skred.inference.hierarchical import HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.laws import load_law
from skred.work.calibrate import MORE, calibrate_surely

LAW = load_law("constant")


def problem() -> HierarchicalProblem:
    return hierarchical_problem(of_events(read_campaign(find_campaign("ryggfonn")), range(8)))


def test_enough_the_first_time() -> None:
    given, settings = problem(), SamplerSettings(draws=600, tune=400, seed=1)
    found = calibrate_surely(given, LAW, settings)
    assert found.gate.passed and found.settings == settings and found.problem is given


def test_short_chains_are_made_longer() -> None:
    given = problem()
    found = calibrate_surely(given, LAW, SamplerSettings(draws=60, tune=100, seed=1))
    assert found.gate.passed
    assert (found.settings.draws, found.settings.tune) == (MORE * 60, MORE * 100)
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
