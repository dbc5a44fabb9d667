"""Simulation-based calibration: that it can fail, that it counts and resumes, and a small run of M2."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arviz_stats.ecdf_utils import ecdf_pit
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.files import as_rows, read
from skred.campaign import Status
from skred.errors import InputError
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law


@pytest.fixture(scope="module")
def sbc() -> Any:
    return importlib.import_module("benchmarks.sbc")


# A Gaussian toy: mu ~ N(0, 1), three readings y ~ N(mu, 1), whose posterior is known.

Readings = np.ndarray
N_EVENTS = 3


def gaussian_posterior(readings: Readings, variance: float) -> tuple[float, float]:
    precision = 1.0 + len(readings) / variance
    return readings.sum() / variance / precision, precision**-0.5


POSTERIORS: dict[str, Callable[[Readings], tuple[float, float]]] = {
    "right": lambda y: gaussian_posterior(y, 1.0),
    "Sigma times 4": lambda y: gaussian_posterior(y, 4.0),
    "Sigma by 4": lambda y: gaussian_posterior(y, 0.25),
    "an event dropped": lambda y: gaussian_posterior(y[1:], 1.0),
    "biased": lambda y: (gaussian_posterior(y, 1.0)[0] + 0.3, 0.5),
}


def toy_ranks(sbc: Any, posterior: str, n: int = 300) -> dict[str, Any]:
    ranks: dict[str, list[int]] = {"mu": [], "log_likelihood": []}
    for number in range(n):
        rng = np.random.default_rng([11, number])
        mu = rng.standard_normal()
        readings = mu + rng.standard_normal(N_EVENTS)
        mean, sd = POSTERIORS[posterior](readings)
        draws = mean + sd * rng.standard_normal(sbc.N_RANKED)
        fit = -0.5 * ((readings[:, None] - np.append(draws, mu)) ** 2).sum(axis=0)
        ranks["mu"].append(sbc.rank(mu, draws, rng))
        ranks["log_likelihood"].append(sbc.rank(fit[-1], fit[:-1], rng))
    return {name: sbc.uniformity(values) for name, values in ranks.items()}


def test_a_right_posterior_passes(sbc: Any) -> None:
    for result in toy_ranks(sbc, "right").values():
        assert result.inside_band and result.ecdf_p > 0.05 and result.chi_square_p > 0.01


@pytest.mark.parametrize("wrong", [name for name in POSTERIORS if name != "right"])
def test_a_wrong_posterior_is_found(sbc: Any, wrong: str) -> None:
    results = toy_ranks(sbc, wrong).values()
    assert min(result.ecdf_p for result in results) < 0.001
    assert not all(result.inside_band for result in results)
    assert min(result.chi_square_p for result in results) < 0.01


def test_a_dropped_event_shows_in_the_log_likelihood_alone(sbc: Any) -> None:
    """Which is why it is ranked: the posterior from fewer events is calibrated for the parameter."""
    results = toy_ranks(sbc, "an event dropped")
    assert results["mu"].ecdf_p > 0.01 and results["log_likelihood"].ecdf_p < 0.001


@pytest.mark.parametrize("n", [15, 100])
def test_false_alarms_are_as_many_as_stated(sbc: Any, n: int) -> None:
    rng = np.random.default_rng(5)
    results = [sbc.uniformity(rng.integers(200, size=n)) for _ in range(80)]
    assert sum(not result.inside_band for result in results) <= 10  # 4 expected
    p_values = np.array([result.ecdf_p for result in results])
    assert 0.3 < p_values.mean() < 0.7
    for result in results:
        assert result.inside_band == (result.ecdf_p > 0.05) or 0.03 < result.ecdf_p < 0.07


def test_band_is_arvizs(sbc: Any) -> None:
    ranks = np.random.default_rng(0).integers(200, size=200)
    ours = sbc.uniformity(ranks)
    at, _, lower, upper = ecdf_pit((ranks + 0.5) / 200, 0.95, 2000)
    assert_allclose(ours.at, at[1:-1])
    assert np.abs(ours.lower + ours.at - lower[1:-1]).max() < 0.011  # one rank is 0.005
    assert np.abs(ours.upper + ours.at - upper[1:-1]).max() < 0.011


def test_ecdf_of_ranks(sbc: Any) -> None:
    result = sbc.uniformity([0, 0, 1, 3], n_ranked=3)
    assert_allclose(result.at, [0.25, 0.5, 0.75])
    assert_allclose(result.ecdf_difference + result.at, [0.5, 0.75, 0.75])


def test_rank_among_ties_is_any(sbc: Any) -> None:
    draws = np.array([1.0, 2.0, 2.0, 2.0, 3.0])
    ranks = [sbc.rank(2.0, draws, np.random.default_rng(seed)) for seed in range(60)]
    assert set(ranks) == {1, 2, 3, 4}
    assert sbc.rank(0.0, draws, np.random.default_rng(0)) == 0
    assert sbc.rank(9.0, draws, np.random.default_rng(0)) == 5


def test_thinning_takes_from_all_chains(sbc: Any) -> None:
    draws = np.arange(800.0).reshape(4, 200)
    thinned = sbc.thin(draws, 199)
    assert len(np.unique(thinned)) == 199
    assert_allclose(np.bincount((thinned // 200).astype(int)), 50, atol=1)


def test_what_is_recorded(sbc: Any, problem: Any) -> None:
    latent = np.full((22, 4), 5.0)
    latent[:, 1], latent[:, 3] = -1.0, -20.0
    fresh = sbc.recorded(problem, latent)
    gaps = problem.campaign.status == Status.MISSING
    assert_array_equal(fresh.campaign.status == Status.MISSING, gaps)
    assert np.all(fresh.not_reached[~gaps[:, 1], 1]) and not fresh.not_reached[:, [0, 2, 3]].any()
    assert_array_equal(fresh.values[fresh.observed], latent[fresh.observed])
    assert np.all(fresh.observed[:, 3])  # a runout is a place and always recorded
    assert fresh.covariance is problem.covariance


# Counting and resuming


class Fake:
    """Stands for the costly calibrator; simulation 2 raises, 4 fails its gate."""

    interrupt_at: int | None = None

    def __init__(self, *args: Any) -> None: ...

    def calibrate(self, number: int) -> dict[str, Any]:
        if number == self.interrupt_at:
            raise KeyboardInterrupt
        if number == 2:
            raise RuntimeError("no luck")
        names = ("dry_friction", "turbulent_drag", "log_likelihood")
        gate = {"passed": number != 4, "problems": [] if number != 4 else ["r-hat 2 exceeds 1.01"]}
        return {
            "number": number,
            "ranks": dict.fromkeys(names, (37 * number) % 200),
            "attempts": 2 if number == 4 else 1,
            "gate": gate,
            "seconds": 1.0,
        }


def run(
    sbc: Any, monkeypatch: pytest.MonkeyPatch, out: Path, interrupt_at: int | None = None, **options: Any
) -> int:
    monkeypatch.setattr(sbc, "Calibrator", Fake)
    monkeypatch.setattr(Fake, "interrupt_at", interrupt_at)
    return int(sbc.main(n=8, out=out, **options))


def test_failures_are_counted_and_shown(
    sbc: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run(sbc, monkeypatch, tmp_path / "sbc.json")
    told = capsys.readouterr().out
    assert code == 1
    assert "1 errors" in told and "1 failed the gate" in told
    assert "simulation 2: RuntimeError: no luck" in told and "simulation 4: r-hat 2" in told
    document = json.loads((tmp_path / "sbc.json").read_text())
    assert document["summary"]["n"] == 8 and document["summary"]["errors"] == 1
    assert document["summary"]["uniformity"]["dry_friction"]["n"] == 7  # a failed gate is kept
    assert (tmp_path / "sbc.png").stat().st_size > 10_000


def test_an_interrupted_run_goes_on(sbc: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.json", tmp_path / "parts.json"
    run(sbc, monkeypatch, whole)
    with pytest.raises(KeyboardInterrupt):
        run(sbc, monkeypatch, parts, interrupt_at=5)
    assert [record["number"] for record in as_rows(read(parts)["simulations"])] == list(range(5))
    run(sbc, monkeypatch, parts)
    assert read(parts) == read(whole)


def test_a_run_with_other_settings_is_not_mixed_in(
    sbc: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run(sbc, monkeypatch, tmp_path / "sbc.json")
    with pytest.raises(InputError, match="other settings"):
        run(sbc, monkeypatch, tmp_path / "sbc.json", seed=1)


def test_small_calibration_of_m2(sbc: Any, problem: Any) -> None:
    """Seeds are fixed; the full run is in benchmarks/results."""
    settings = SamplerSettings(draws=300, tune=200, chains=2)
    calibrator = sbc.Calibrator(problem, load_law("pcm"), 3, settings)
    truth, simulated = calibrator.simulate(4)
    again = calibrator.simulate(4)
    assert truth == again[0]
    assert_array_equal(simulated.values, again[1].values)
    quantities = ["dry_friction", "turbulent_drag", sbc.LOG_LIKELIHOOD]
    records = list(sbc.simulations(calibrator, range(5)))
    summary = sbc.summarise(records, quantities)
    assert summary["errors"] == 0, records
    assert summary["gate_failed"] <= 1
    for name in quantities:
        assert summary["uniformity"][name]["ecdf_p"] > 0.01, (name, summary)
