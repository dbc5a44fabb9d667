"""The check of fit: rarely wrong where the model is right, and never silent where it misses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from skred.inference.fit import (
    FIT_LEVEL,
    adjusted_p_values,
    calibration_statement,
    fit_entries,
    fit_sentences,
    missed_sensors,
)
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.results import summary

ALL = np.full((2, 8), True)


def statistics(rng: np.random.Generator, n: int) -> np.ndarray:
    """Statistics of n sets of recordings: two of each of eight sensors, together and skewed."""
    shared = rng.standard_normal((n, 1, 1))
    return np.asarray(np.exp(0.4 * (shared + rng.standard_normal((n, 2, 8)))))


def test_alarms_are_as_rare_as_stated() -> None:
    """A set of recordings like those predicted is beyond the limit once in a hundred, over all sensors."""
    rng, n = np.random.default_rng(1), 1500
    predicted = statistics(rng, 4000)
    alarms = sum(adjusted_p_values(one, predicted, ALL).min() <= FIT_LEVEL for one in statistics(rng, n))
    low, high = binom.interval(0.999, n, FIT_LEVEL)
    assert low <= alarms <= high


def test_one_statistic_among_many_that_is_far_off() -> None:
    rng = np.random.default_rng(2)
    predicted = rng.standard_normal((2000, 2, 8))
    recorded = np.zeros((2, 8))
    recorded[1, 5] = 6.0
    p = adjusted_p_values(recorded, predicted, ALL)
    assert p[1, 5] == pytest.approx(1.0 / 2001.0) and p[0].min() > 0.9


def test_what_never_varies_and_what_cannot_be_tested() -> None:
    predicted = np.random.default_rng(3).standard_normal((500, 2, 8))
    predicted[:, 0, 0] = predicted[:, 1, 0] = 0.0  # a front that never comes
    recorded, testable = np.zeros((2, 8)), ALL.copy()
    recorded[0, 0], recorded[0, 1] = 3.0, 40.0
    testable[0, 1] = False
    p = adjusted_p_values(recorded, predicted, testable)
    assert p[0, 0] <= 1.0 / 501.0 and p[1, 0] == 1.0 and p[0, 1] == 1.0


def test_gaps_count_for_nothing_and_stops_as_zero(problem: Any) -> None:
    campaign, rng = problem.campaign, np.random.default_rng(4)
    known = problem.observed | problem.not_reached
    recorded = np.where(problem.observed, campaign.values, 0.0)
    predicted = recorded + rng.standard_normal((400, *recorded.shape))
    predicted[:, ~known] = 1e6
    rows = fit_entries(problem, predicted)["fit"]
    for k, row in enumerate(rows):
        assert row["n_recorded"] == known[:, k].sum()
        assert row["recorded_mean"] == pytest.approx(recorded[known[:, k], k].mean())
        assert row["predicted_mean"] == pytest.approx(row["recorded_mean"], abs=0.1)
        assert row["predicted_mean_se"] == pytest.approx(1.0 / np.sqrt(row["n_recorded"]), rel=0.2)
        assert row["inside"] == 1.0 and row["p_mean"] > 0.5


def test_m2_fits_the_mean_response_of_ryggfonn(calibration: Any) -> None:
    entry = calibration.entry()
    assert entry["fits"] and all(row["fits"] for row in entry["fit"]) and fit_sentences(entry) == []
    assert [row["sensor"] for row in entry["fit"]] == list(calibration.problem.campaign.sensor_ids)
    converged, fits = calibration_statement(entry)
    assert converged.startswith("The chains converged (r-hat at most 1.0")
    assert fits.startswith("No misfit was found in the mean or the standard deviation of the readings")
    assert "That says little: the scatter around the response was fitted to the same readings" in fits


def test_converged_chains_that_miss_a_sensor_are_not_called_good(calibration: Any) -> None:
    """Recordings with 15 m/s less at one sensor, judged by the response that fits the real ones."""
    problem, k = calibration.problem, 1
    values = problem.campaign.values.copy()
    values[:, k] = np.maximum(values[:, k] - 15.0, 0.0)
    slower = replace(problem, campaign=replace(problem.campaign, values=values))
    entry = calibration.entry() | summary(slower, calibration.law, calibration.tree)
    assert not entry["fits"] and [row["fits"] for row in entry["fit"]] == [True, False, True, True]
    assert entry["fit"][k]["p_mean"] <= FIT_LEVEL
    name = problem.campaign.sensor_ids[k]
    first, *rest = calibration_statement(entry)
    assert first.startswith("The chains converged") and first.endswith(f"misses the recordings at {name}.")
    assert rest[0].startswith(f"At {name} it predicts a mean reading of ") and len(rest) == 1
    failed = entry | {"gate": entry["gate"] | {"passed": False, "problems": ["r-hat 1.2"]}}
    assert calibration_statement(failed)[0].startswith("THE CHAINS DID NOT CONVERGE")


def row(sensor: str, fits: bool, **changes: Any) -> dict[str, Any]:
    values = {"n_recorded": 9, "recorded_mean": 1700.4, "predicted_mean": 1500.0, "p_mean": 0.001}
    values |= {"recorded_sd": 20.0, "predicted_sd": 90.0, "p_sd": 0.9}
    return {"sensor": sensor, "unit": "m", "fits": fits, **values, **changes}


def test_sentences_name_the_worst_first() -> None:
    entry = {"fit": [row("a", False, p_sd=1e-4), row("b", True), row("c", False)]}
    assert missed_sensors(entry) == "a and c"
    first, second = fit_sentences(entry)
    assert first.startswith(
        "At a it predicts a standard deviation between avalanches of 90 m; the 9 recorded"
    )
    assert first.endswith("avalanches have 20 m.")
    assert second == "At c it predicts a mean reading of 1500 m; the 9 recorded avalanches have 1700 m."
    many = {"fit": [row(f"v{k}", False) for k in range(9)]}
    assert missed_sensors(many) == "9 of 9 sensors"
    assert fit_sentences(many)[-1] == "It misses at 6 further sensors too."


def test_what_a_pass_is_worth_is_told_by_the_likelihood(problem: Any) -> None:
    recorded = np.where(problem.observed, problem.campaign.values, 0.0)
    predicted = recorded + np.random.default_rng(4).standard_normal((40, *recorded.shape))
    for kind, part in (
        (problem, "the scatter around the response was fitted"),
        (hierarchical_problem(problem.campaign), "how much avalanches differ was fitted"),
    ):
        assert fit_entries(kind, predicted)["fit_caution"].startswith(f"That says little: {part}")
