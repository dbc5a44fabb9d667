"""Runouts for return periods in closed form, told everywhere; priors that were changed likewise."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from prediction_cases import folder_of, tree_of

import skred
from skred.campaign import find_campaign, read_campaign
from skred.cli.main import run
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.prediction.return_periods import runouts_once_in
from skred.prediction.wanted import Rate, Wanted
from skred.report.folders import write_reports


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def exponential(populations: int, scale_m: np.ndarray, n: int = 4096) -> np.ndarray:
    """Runouts beyond 1000 m, each scale's quantiles at even steps."""
    steps = (np.arange(n) + 0.5) / n
    return 1000.0 - np.log(steps)[None] * scale_m.reshape(populations, 1)


def test_closed_form() -> None:
    """P(R > s) = exp(-(s - 1000) / h): once in T years s = 1000 + h ln(rate T)."""
    runouts = exponential(1, np.array([100.0]))
    rate = np.array([0.2])
    for row in runouts_once_in((10.0, 50.0, 300.0), runouts, rate, 5000.0):
        expected = 1000.0 + 100.0 * np.log(0.2 * row["years"])
        for end in ("value", "low", "high"):
            assert row[end] == pytest.approx(expected, abs=1.0)
        assert row["at_least"] is False


def test_interval_over_populations_and_rates() -> None:
    rng = np.random.default_rng(4)
    scales, rate = rng.uniform(60.0, 140.0, 200), rng.uniform(0.1, 0.3, 200)
    [row] = runouts_once_in((100.0,), exponential(200, scales), rate, 5000.0)
    each = 1000.0 + scales * np.log(100.0 * rate)
    low, high = np.quantile(each, [0.05, 0.95])
    assert (row["low"], row["high"]) == pytest.approx((low, high), abs=3.0)
    # Of all together the mean frequency of passing the value is 1 / T.
    passing = float((rate * np.exp(-(row["value"] - 1000.0) / scales)).mean())
    assert passing == pytest.approx(0.01, rel=0.02)
    assert row["low"] < row["value"] < row["high"]


def test_times_in_which_no_avalanche_starts() -> None:
    runouts = exponential(3, np.full(3, 100.0))
    rows = runouts_once_in((2.0, 4.0, 40.0), runouts, np.array([0.1, 0.3, 0.5]), 1230.0)
    assert rows[0]["value"] is None and rows[0]["low"] is None and rows[0]["high"] is None
    assert rows[1]["low"] is None and rows[1]["value"] is not None and rows[1]["high"] is not None
    assert rows[2]["at_least"] is True


def test_a_population_where_none_starts() -> None:
    """A gamma distribution with a wide SD has rates that are 0 as far as a computer can tell."""
    rate = Rate(0.01, 0.1).drawn(np.array([1e-5, 0.5, 0.999]))
    assert rate[0] == 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        [row] = runouts_once_in((30.0,), exponential(3, np.full(3, 100.0)), rate, 5000.0)
    assert row["low"] is None and row["high"] > 1000.0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"return_periods_years": (30.0,)}, "needs --per-year"),
        ({"return_periods_years": (-1.0,), "rate": Rate(1.0)}, "expected years"),
        ({"return_periods_years": (float("nan"),), "rate": Rate(1.0)}, "expected years"),
        ({"return_periods_years": (1e4,), "rate": Rate(2.0)}, "at most 171 years"),
    ],
)
def test_what_is_refused(options: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        Wanted(**options).check_on(1000.0)  # type: ignore[arg-type]


def test_told_in_terminal_json_and_page(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    out = tmp_path / "out"
    times = ["--per-year", "0.2,0.05", "--return-period", "8", "10", "12"]
    assert run(["predict", "--from", str(folder), *times, "--out", str(out)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    document = json.loads((out / "prediction.json").read_text())
    rows = document["runout"]["once_in"]
    assert [row["years"] for row in rows] == [8, 10, 12]
    values = [row["value"] for row in rows]
    assert values == sorted(values)
    for row in rows:
        assert row["low"] is None or row["low"] < row["value"] < row["high"]
        assert f"runout reached once in {row['years']:g} years {row['value']:.0f}" in told
        assert f"once in {row['years']:g} years an avalanche passes s = {row['value']:.0f} m" in told
    page = (out / "report.html").read_text()
    assert "Runout for a return period" in page and f"{rows[2]['value']:.0f} (" in page
    (out / "report.html").unlink()
    write_reports(out)
    assert (out / "report.html").read_text() == page


def test_changed_priors_are_told(problem: HierarchicalProblem, tmp_path: Path) -> None:
    tree = tree_of(problem, "coulomb")
    tree.attrs["changed_priors"] = json.dumps({"dry_friction": 0.9})
    folder, out = folder_of(tmp_path / "made", tree), tmp_path / "out"
    assert run(["predict", "--from", str(folder), "--quiet", "--out", str(out)]) == 0
    document = json.loads((out / "prediction.json").read_text())
    assert document["changed_priors"] == {"dry_friction": 0.9}
    note = "Priors were changed: of coulomb the scale of dry_friction 0.9."
    assert note in document["statement"]
    assert note in (out / "report.html").read_text()


def test_a_folder_takes_no_priors(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    priors = tmp_path / "priors.toml"
    priors.write_text("dry_friction = 0.5\n")
    assert run(["predict", "--from", str(folder), "--priors", str(priors)]) == 2
    assert "made already; leave out --priors" in capsys.readouterr().err


def test_priors_of_a_prediction_that_samples(tmp_path: Path) -> None:
    result = skred.predict(
        "coulomb", priors={"dry_friction": 0.9}, draws=100, tune=100, chains=2, at={"house": 1800.0}
    )
    assert result.document["changed_priors"] == {"dry_friction": 0.9}
    assert json.loads(result.posterior.attrs["changed_priors"]) == {"dry_friction": 0.9}


@pytest.mark.slow
def test_a_folder_from_python(problem: HierarchicalProblem, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    result = skred.predict(
        from_folder=folder, at={"house": 1800.0}, per_year=(0.2, 0.05), return_periods_years=[30.0]
    )
    assert [row["name"] for row in result.document["at"]] == ["house"]
    assert result.document["runout"]["once_in"][0]["years"] == 30.0
    assert (result.report(tmp_path / "out") / "x").parent.name == "report.html"
    with pytest.raises(InputError, match="leave out law"):
        skred.predict("pcm", from_folder=folder)


@pytest.mark.slow
def test_another_track_is_checked_as_validate_does(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What smoothing takes from a zigzag, and a track that does not begin at 0, are told."""
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    x = 7.0 + 5.0 * np.arange(240)
    z = 800.0 - 0.5 * x + 1.5 * (-1.0) ** np.arange(240)
    file = tmp_path / "other.csv"
    file.write_text("x_m,z_m\n" + "".join(f"{a},{b}\n" for a, b in zip(x, z, strict=True)))
    assert run(["predict", "--from", str(folder), "--track", str(file), "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert (
        "warning: other.csv" in told
        and "x_m" in told
        and "% longer than the track smoothed over 10 m" in told
    )
    file.write_text("x_m,z_m\n0,300\n10,200\n500,14000\n")
    assert run(["predict", "--from", str(folder), "--track", str(file)]) == 2
    assert "other.csv, row 3" in capsys.readouterr().err
