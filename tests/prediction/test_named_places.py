"""Named places: arrival, speed, pressure and frequency in closed form, and what is refused."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from page_checks import check_page
from prediction_cases import folder_of, plane, tree_of
from scipy.special import ndtr, ndtri

from skred.campaign import find_campaign, read_campaign
from skred.cli.main import run
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.kernel.columns import GRAVITY
from skred.physics.laws import load_law
from skred.prediction.at_places import annual_exceedance
from skred.prediction.places_table import BYTE_ORDER_MARK, COLUMNS, places_table
from skred.prediction.predict import Simulation, prediction_of
from skred.prediction.track import prediction_track
from skred.prediction.wanted import Rate, Wanted, impact_pressure_kpa

SLOPE = np.radians(32.0)
S_M = 800.0


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def rows_of(problem: HierarchicalProblem, track: Any, wanted: Wanted, n: int = 2048) -> list[dict[str, Any]]:
    data = prediction_of(
        problem, load_law("coulomb"), tree_of(problem, "coulomb"), track, Simulation(80, n), wanted=wanted
    )
    return list(json.loads(data.attrs["at"]))


@pytest.fixture(scope="module")
def populations(problem: HierarchicalProblem) -> tuple[np.ndarray, np.ndarray]:
    posterior = tree_of(problem, "coulomb")["posterior"]
    return (
        np.log(posterior["dry_friction"].values.ravel()),
        posterior["dry_friction_spread"].values.ravel(),
    )


def test_coulomb_friction_on_a_plane(
    problem: HierarchicalProblem, populations: tuple[np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    """U^2 = 2 g s (sin phi - mu cos phi), and mu is log-normal across avalanches."""
    mean, sd = populations
    density, drag = 200.0, 1.5
    fast = 40.0
    pressure = float(impact_pressure_kpa(fast, density, drag))
    wanted = Wanted((("mast", S_M),), (fast,), (pressure,), (density, density), (drag, drag), Rate(0.3))
    (row,) = rows_of(problem, prediction_track(problem, plane(tmp_path)), wanted)
    limit = (np.sin(SLOPE) - fast**2 / (2.0 * GRAVITY * S_M)) / np.cos(SLOPE)
    faster = ndtr((np.log(limit) - mean) / sd)
    comes = ndtr((np.log(np.tan(SLOPE)) - mean) / sd)
    above = row["speed"]["above"][0]
    assert row["reached"]["value"] == pytest.approx(comes.mean(), abs=0.002)
    assert above["value"] == pytest.approx(faster.mean(), abs=0.003)
    assert [above["low"], above["high"]] == pytest.approx(np.quantile(faster, [0.05, 0.95]), abs=0.006)
    # The same threshold as a pressure, with density and drag coefficient known.
    assert row["pressure"]["above"][0]["value"] == pytest.approx(above["value"], abs=1e-12)
    assert above["annual"]["value"] == pytest.approx((1.0 - np.exp(-0.3 * faster)).mean(), abs=0.002)
    period = above["return_period_years"]
    assert period["value"] == pytest.approx(1.0 / (0.3 * faster.mean()), rel=0.01)
    low, high = np.quantile(0.3 * faster, [0.05, 0.95])
    assert [period["low"], period["high"]] == pytest.approx([1.0 / high, 1.0 / low], rel=0.03)
    every = np.exp(mean[:, None] + sd[:, None] * ndtri((np.arange(4000) + 0.5) / 4000))
    speed = np.sqrt(np.maximum(2.0 * GRAVITY * S_M * (np.sin(SLOPE) - every * np.cos(SLOPE)), 0.0))
    for share, got in ((0.5, row["speed"]["exceeded_by"][0]), (0.1, row["speed"]["exceeded_by"][1])):
        assert got["share"] == share
        assert got["value"] == pytest.approx(np.quantile(speed, 1.0 - share), abs=0.3)
    coming = row["speed"]["given_reached"][0]["value"]
    assert coming == pytest.approx(np.quantile(speed[speed > 0.0], 0.5), abs=0.3)


def test_pressure_over_ranges(
    problem: HierarchicalProblem, populations: tuple[np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    """P(p > P), the density and the drag coefficient integrated over on a fine grid."""
    mean, sd = populations
    wanted = Wanted((("mast", S_M),), (), (150.0,), (100.0, 300.0), (1.0, 2.0))
    (row,) = rows_of(problem, prediction_track(problem, plane(tmp_path)), wanted, n=8192)
    unit = (np.arange(60) + 0.5) / 60
    factor = np.outer(100.0 + 200.0 * unit, 1.0 + unit).ravel()
    square = 150.0 / (0.5e-3 * factor)
    limit = (np.sin(SLOPE) - square / (2.0 * GRAVITY * S_M)) / np.cos(SLOPE)
    with np.errstate(invalid="ignore", divide="ignore"):
        chance = ndtr((np.log(np.maximum(limit, 0.0))[None] - mean[:, None]) / sd[:, None])
    assert row["pressure"]["above"][0]["value"] == pytest.approx(chance.mean(), abs=0.02)


def test_the_formula() -> None:
    assert impact_pressure_kpa(30.0, 300.0, 2.0) == pytest.approx(270.0)
    assert annual_exceedance(0.1, 0.5) == pytest.approx(1.0 - np.exp(-0.05))
    uniform = (np.arange(2000) + 0.5) / 2000
    drawn = Rate(0.2, 0.05).drawn(uniform)
    assert drawn.mean() == pytest.approx(0.2, rel=1e-3) and drawn.std() == pytest.approx(0.05, rel=0.01)
    assert (Rate(0.2).drawn(uniform) == 0.2).all()


def test_scenarios_of_release_are_weighted(problem: HierarchicalProblem) -> None:
    wanted = Wanted((("above", 400.0), ("below", 1900.0)))
    apart = [rows_of(problem, prediction_track(problem, None, s), wanted) for s in (0.0, 700.0)]
    track = prediction_track(problem, None, [(0.0, 1.0), (700.0, 3.0)])
    assert "0 m (25 %) or 700 m (75 %)" in track.release_text
    both = rows_of(problem, track, wanted)
    for k in range(2):
        expected = np.average([one[k]["reached"]["value"] for one in apart], weights=[1.0, 3.0])
        assert both[k]["reached"]["value"] == pytest.approx(expected, abs=0.02)
    assert apart[1][0]["reached"]["value"] == 0.0
    assert "each as likely" in prediction_track(problem, None, [(0.0, 2.0), (50.0, 2.0)]).release_text


def test_a_place_that_none_reaches_has_no_return_period(problem: HierarchicalProblem, tmp_path: Path) -> None:
    wanted = Wanted((("summit", 0.0),), rate=Rate(1.0, 0.2))
    track = prediction_track(problem, None, 500.0)
    (row,) = rows_of(problem, track, wanted, n=64)
    assert row["reached"]["value"] == 0.0 and row["speed"]["given_reached"] == []
    assert row["reached"]["return_period_years"] == {"value": None, "low": None, "high": None}


def test_no_return_period_is_longer_than_the_simulation_can_tell(problem: HierarchicalProblem) -> None:
    """A runout so rare is refused; a speed is told as rarer than what 3 of the avalanches say."""
    n, rate = 64, Rate(0.5)
    longest = n / (3 * 0.5)
    speeds = tuple(np.arange(1.0, 100.0, 2.0))
    wanted = Wanted((("farm", 1900.0),), speeds, rate=rate)
    (row,) = rows_of(problem, prediction_track(problem, None, 0.0), wanted, n=n)
    told = [one["return_period_years"] for one in row["speed"]["above"] if one["value"] > 0.0]
    rare = [one for one in told if one["value"] is None]
    assert rare and all(one["low"] <= longest and one["high"] is None for one in rare)
    assert any(one["low"] == longest for one in rare)
    for one in told:
        known = [end for end in one.values() if end is not None]
        assert max(known) <= longest
        if one["value"] is not None:
            assert one["low"] <= one["value"] and (one["high"] is None or one["value"] <= one["high"])


def test_the_table_and_the_page(problem: HierarchicalProblem, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    out = tmp_path / "out"
    words = ["predict", "--from", str(folder), "--out", str(out), "--quiet", "--at", "hut=1900"]
    assert run([*words, "--at", "Brücke=1700", "--pressure", "30", "--per-year", "0.2,0.1"]) == 0
    text = (out / "places.csv").read_bytes().decode("utf-8")
    assert text.startswith(BYTE_ORDER_MARK)
    rows = list(csv.reader(text[1:].splitlines()))
    assert tuple(rows[0]) == COLUMNS and {len(row) for row in rows} == {len(COLUMNS)}
    assert [row[0] for row in rows if row[2] == "avalanche comes: return period"] == ["Brücke", "hut"]
    assert all(float(number) >= 0.0 for row in rows[1:] for number in row[5:])
    page = (out / "report.html").read_text(encoding="utf-8")
    for said in (
        "hut",
        "Brücke",
        "0.5 C_d rho U^2",
        "10.3390/geosciences10010002",
        "selection",
        "return period",
    ):
        assert said in page
    check_page(page)
    assert page.count("<figure") == 3 and page.count("<svg") == 6 and page.count("<script>") == 1
    before = {file.name: file.read_bytes() for file in out.iterdir() if file.suffix in (".svg", ".html")}
    for name in before:
        (out / name).unlink()
    assert run(["report", str(out)]) == 0
    assert {name: (out / name).read_bytes() for name in before} == before
    document = json.loads((out / "prediction.json").read_text())
    assert document["rate"] == {"per_year": 0.2, "sd_per_year": 0.1, "distribution": "gamma"}
    said = " ".join(document["statement"])
    assert "your frequency of 0.2" in said and "selection" in said and "not per year" not in said
    with xr.open_datatree(out / "prediction.nc", engine="h5netcdf") as tree:
        assert tree["speed_exceedance"].dims == ("at", "speed_threshold")


@pytest.mark.slow
def test_a_place_above_some_releases_is_told(problem: HierarchicalProblem, tmp_path: Path) -> None:
    """Fewer come there than to a place further down, which looks like a fault."""
    folder, out = folder_of(tmp_path / "made", tree_of(problem, "coulomb")), tmp_path / "out"
    words = ["--release", "0", "--release", "1000:3", "--at", "upper=900", "--at", "hut=1100", "--quiet"]
    assert run(["predict", "--from", str(folder), "--out", str(out), *words]) == 0
    document = json.loads((out / "prediction.json").read_text())
    chances = {place["name"]: place["reached"]["value"] for place in document["at"]}
    assert chances["upper"] < chances["hut"]
    told = {name: next(s for s in document["statement"] if f"reach {name} " in s) for name in chances}
    assert "above some of the releases" in told["upper"] and "releases" not in told["hut"]


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("=1+cmd|A1", "'=1+cmd|A1"),
        ('=HYPERLINK("http://x","y")', '\'=HYPERLINK("http://x","y")'),
        ("+1", "'+1"),
        ("-1", "'-1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t'=1"),
        (" =1", "' =1"),
        ("mast;=1+1", "mast;'=1+1"),
        ("v-1 (a=b)", "v-1 (a=b)"),
        ("Brücke", "Brücke"),
    ],
)
def test_names_of_others_are_no_formulas(name: str, written: str) -> None:
    band = {"value": 0.5, "low": 0.4, "high": 0.6}
    quantity = {"unit": "m/s", "given_reached": [], "exceeded_by": [], "above": []}
    place = {"name": name, "s_m": 10.0, "reached": band, "speed": quantity, "pressure": quantity}
    rows = list(csv.reader(io.StringIO(places_table({"at": [place]}), newline="")))
    assert rows[1][:3] == [written, "10.0", "avalanche comes: probability for an avalanche"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--at", "1830"], "NAME=S"),
        (["--at", "house=far"], "a number"),
        (["--at", "house=99999"], "on the track"),
        (["--at", "=3+4=1"], "a name"),
        (["--at", "a=1", "--at", "a=2"], "twice"),
        (["--speed", "-1"], "--speed"),
        (["--pressure", "-1"], "--pressure"),
        (["--density", "300,100"], "LOW <= HIGH"),
        (["--density", "300,400,500"], "two with a comma"),
        (["--drag-coefficient", "0,1"], "LOW <= HIGH"),
        (["--per-year", "0"], "--per-year"),
        (["--per-year", "0.1,-1"], "SD"),
        (["--per-year", "often"], "--per-year"),
        (["--release", "top"], "S:WEIGHT"),
        (["--release", "0:-1"], "weight"),
        (["--release", "99999"], "on the track"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_sampling(
    words: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["predict", "ryggfonn", "--out", str(tmp_path / "out"), *words]) == 2
    assert expected in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_too_many_places() -> None:
    with pytest.raises(InputError, match="at most 20"):
        Wanted(tuple((f"p{k}", 1.0) for k in range(21)))
