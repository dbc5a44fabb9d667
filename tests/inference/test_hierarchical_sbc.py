"""Calibration of the hierarchical likelihood by simulation: that it passes, and that it can fail."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law

N_EVENTS, N_CAMPAIGNS = 6, 12


@pytest.fixture(scope="module")
def benchmark() -> Any:
    return importlib.import_module("benchmarks.hierarchical_sbc")


@pytest.fixture(scope="module")
def calibrator(benchmark: Any) -> Any:
    settings = SamplerSettings(draws=200, tune=150, chains=2)
    return benchmark.Calibrator(benchmark.Design("sparse", N_EVENTS), load_law("coulomb"), 5, settings)


def velocities_too_high(problem: HierarchicalProblem) -> Any:
    readings = problem.readings
    return readings._replace(values=np.where(readings.is_velocity, 1.3 * readings.values, readings.values))


def runouts_off(problem: HierarchicalProblem) -> Any:
    readings = problem.readings
    return readings._replace(values=np.where(readings.is_velocity, readings.values, readings.values + 80.0))


def calibrated(benchmark: Any, calibrator: Any, error: Callable[[HierarchicalProblem], Any] | None) -> Any:
    calibrator.analysed = benchmark.as_it_is
    if error is not None:
        calibrator.analysed = lambda p: benchmark.campaigns.with_readings(p, error(p))
    # The gate does not matter here, and a second try would cost much.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(benchmark.sbc, "SECOND_TRY", 1)
        records = list(benchmark.sbc.simulations(calibrator, range(N_CAMPAIGNS)))
    summary = benchmark.summarise(records, benchmark.quantities_of(calibrator.problem, calibrator.law))
    assert summary["errors"] == 0, records
    return summary["uniformity"]


def test_the_likelihood_belongs_to_the_simulation(benchmark: Any, calibrator: Any) -> None:
    """Seeds are fixed; the full runs are in benchmarks/results."""
    for name, entry in calibrated(benchmark, calibrator, None).items():
        assert entry["ecdf_p"] > 0.01, (name, entry)
        if name != "log_likelihood":
            assert entry["coverage_90"] >= 0.7, (name, entry)


@pytest.mark.slow
@pytest.mark.parametrize("error", [velocities_too_high, runouts_off])
def test_a_planted_error_is_found(
    benchmark: Any, calibrator: Any, error: Callable[[HierarchicalProblem], Any]
) -> None:
    found = calibrated(benchmark, calibrator, error)
    assert min(entry["ecdf_p"] for entry in found.values()) < 0.001
    assert min(entry.get("coverage_90", 1.0) for entry in found.values()) < 0.7


def test_a_simulation_depends_on_its_number_alone(benchmark: Any, calibrator: Any) -> None:
    truth, first = calibrator.simulate(3)
    again, second = calibrator.simulate(3)
    assert truth == again
    assert_array_equal(first.strengths, second.strengths)
    assert_array_equal(first.problem.readings.values, second.problem.readings.values)


def test_what_is_read_is_what_the_stop_was_seen_to_pass(benchmark: Any, calibrator: Any) -> None:
    law, design = calibrator.law, benchmark.Design("dense", 200).problem()
    population = benchmark.campaigns.typical_population(law)
    simulated = benchmark.campaigns.simulated(design, law, population, np.random.default_rng(1))
    readings = simulated.problem.readings
    places = np.array([sensor.s_to_m for sensor in design.campaign.sensors[:-1]])
    assert_array_equal(readings.observed[:, :-1], places <= readings.reached[:, None])
    assert np.all(readings.observed[:, -1])  # the runout
    assert np.all(readings.reached < readings.not_reached)
    # Far from gates in standard deviations, near in metres: seen where it was, but for some metres.
    assert np.all(simulated.stops > readings.reached - 5 * readings.place_sd)
    assert np.all(simulated.stops < readings.not_reached + 5 * readings.place_sd)
    residual = (readings.values[:, -1] - simulated.stops) / readings.absolute_sd[-1]
    assert_allclose(np.median(np.abs(residual)), 0.674, atol=0.15)  # of a normal deviation


def test_new_recordings_do_not_keep_old_surfaces(calibrator: Any) -> None:
    law = calibrator.law
    first, second = (calibrator.simulate(k)[1].problem for k in (0, 1))
    weights = [problem.surfaces(law.mechanisms).log_weights for problem in (first, second)]
    assert weights[0].shape != weights[1].shape or not np.array_equal(*weights)
