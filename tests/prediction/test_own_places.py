"""Places that nobody asked for: the reference and the lowest sensors, and what is left out is told."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from prediction_cases import folder_of, many_gates, plane, tree_of

from skred.campaign import find_campaign, read_campaign
from skred.cli.main import run
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.prediction.own_places import own_places, places_left_out, shown_places
from skred.prediction.track import prediction_track
from skred.prediction.wanted import MOST_PLACES, Wanted


def problem_with(folder: Path, n_gates: int) -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign(str(many_gates(folder, n_gates)))))


def test_the_reference_stays_and_the_lowest_sensors(tmp_path: Path) -> None:
    problem = problem_with(tmp_path / "gates", 34)
    places = own_places(problem, prediction_track(problem))
    lowest = [(f"gate{k}", 40.0 * k + 40.0) for k in range(15, 34)]
    assert places.shown == [("reference", 50.0), *lowest] and len(places.shown) == MOST_PLACES
    assert places.left_out == [(f"gate{k}", 40.0 * k + 40.0) for k in range(15)]


@pytest.mark.parametrize(("n_gates", "n_left_out"), [(19, 0), (20, 1)])
def test_places_that_fit_are_all_shown(tmp_path: Path, n_gates: int, n_left_out: int) -> None:
    problem = problem_with(tmp_path / "gates", n_gates)
    places = own_places(problem, prediction_track(problem))
    assert len(places.left_out) == n_left_out and len(places.shown) == MOST_PLACES
    assert [s for _, s in places.shown] == sorted(s for _, s in places.shown)


def test_places_asked_for_leave_nothing_out(tmp_path: Path) -> None:
    problem = problem_with(tmp_path / "gates", 34)
    track, wanted = prediction_track(problem), Wanted((("road", 900.0), ("hut", 300.0)))
    assert shown_places(problem, track, wanted) == [("hut", 300.0), ("road", 900.0)]
    assert places_left_out(problem, track, wanted) == []
    other = prediction_track(problem, plane(tmp_path))
    assert shown_places(problem, other, Wanted()) == places_left_out(problem, other, Wanted()) == []


@pytest.mark.slow
def test_what_is_not_shown_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = problem_with(tmp_path / "gates", 34)
    folder, out = folder_of(tmp_path / "made", tree_of(problem, "coulomb")), tmp_path / "out"
    words = ["predict", "--from", str(folder), "--out", str(out)]
    assert run(words) == 0
    line = (
        "Probabilities at 15 sensors farther up (gate0, s = 40 m, to gate14, s = 600 m) are not shown; --at"
        " asks for them."
    )
    assert line in " ".join(capsys.readouterr().out.split())
    document = json.loads((out / "prediction.json").read_text())
    assert [row["name"] for row in document["at"]] == [row["name"] for row in document["places"]]
    assert len(document["places_left_out"]) == 15 and line in document["statement"]
    assert line in " ".join((out / "report.html").read_text(encoding="utf-8").split())
    rows = csv.reader((out / "places.csv").read_text(encoding="utf-8-sig").splitlines())
    assert {"reference", "gate33"} <= {row[0] for row in rows}
