"""A prediction with what a diagnosis added stands beside that of the base law of the same folder."""

from __future__ import annotations

import hashlib
import json
from html import escape
from pathlib import Path

import pytest
from page_checks import check_page
from prediction_cases import folder_of, plane, term_of, tree_of

from skred.campaign import find_campaign, read_campaign
from skred.cli.main import run
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.influence_words import carried, displaced, title_of, too_little
from skred.inference.results import save
from skred.output import write_json
from skred.physics.mechanisms.spec import Shape
from skred.prediction.diagnosis_cautions import diagnosis_cautions
from skred.prediction.source import source_of

ASKED = ["--per-year", "0.2", "--pressure", "30"]


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def diagnosed(problem: HierarchicalProblem, folder: Path, base: str = "base.nc") -> Path:
    """A diagnosis made up: friction on a stretch was added, and the law without it has more friction."""
    term = term_of(problem, "coulomb", "segment_friction", Shape(1200.0, 1500.0))
    folder_of(folder, tree_of(problem, "coulomb", [term], [3.0]), "verdict.json", "augmented.nc")
    tree = tree_of(problem, "coulomb")
    posterior = tree["posterior"].to_dataset()
    posterior["dry_friction"] = 1.1 * posterior["dry_friction"]
    tree["posterior"] = posterior
    tree.attrs["seed"] = 77  # the avalanches are those of the augmented law's seed
    save(tree, folder / base)
    return folder


def test_the_base_law_stands_beside(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = diagnosed(problem, tmp_path / "diagnosed")
    plain = folder_of(tmp_path / "plain", tree_of(problem, "coulomb"))
    tree = tree_of(problem, "coulomb")
    posterior = tree["posterior"].to_dataset()
    tree["posterior"] = posterior.assign(dry_friction=1.1 * posterior["dry_friction"])
    save(tree, plain / "posterior.nc")
    out, alone = tmp_path / "out", tmp_path / "alone"
    there = ["--at", "house=1900", *ASKED]
    assert run(["predict", "--from", str(folder), "--out", str(out), *there]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert run(["predict", "--from", str(plain), "--out", str(alone), "--quiet", *there]) == 0
    document, base = (json.loads((one / "prediction.json").read_text()) for one in (out, alone))
    beside = document["without_added"]
    assert beside["file"] == "base.nc" and beside["at"] == base["at"]
    assert beside["runout"]["exceeded_by"] == base["runout"]["exceeded_by"]
    assert base["without_added"] is None and document["at"] != beside["at"]
    assert "reach it, by the base law" in told and "years, by the base law" in told
    assert "The difference between both is what hangs on what was added." in told
    page = (out / "report.html").read_text(encoding="utf-8")
    check_page(page)
    for said in ("With and without what was added", "By the base law, without what was added,", "base.nc"):
        assert said in page
    assert "With and without" not in (alone / "report.html").read_text(encoding="utf-8")
    assert (out / "places.csv").read_text().splitlines()[0] == (
        alone / "places.csv"
    ).read_text().splitlines()[0]


def test_where_the_effect_is_left_out_that_is_told(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = diagnosed(problem, tmp_path / "diagnosed"), tmp_path / "out"
    words = ["predict", "--from", str(folder), "--out", str(out), "--track", str(plane(tmp_path))]
    assert run([*words, "--at", "house=900"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    meaning = "the coefficients used here were fitted beside it"
    assert meaning in told
    page = " ".join((out / "report.html").read_text(encoding="utf-8").split())
    box = page[page.index("Left out:") :].partition("</p>")[0]
    assert meaning in box and "fitted beside what was added, which is left out here" in page


@pytest.mark.slow
def test_without_places_runouts_are_compared(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = diagnosed(problem, tmp_path / "diagnosed"), tmp_path / "out"
    track = ["--track", str(plane(tmp_path))]
    assert run(["predict", "--from", str(folder), "--out", str(out), *track]) == 0
    assert "m, by the base law" in capsys.readouterr().out
    assert "runout s that 50 % exceed" in (out / "report.html").read_text(encoding="utf-8")


def test_the_base_law_under_the_same_errors_is_taken_first(
    problem: HierarchicalProblem, tmp_path: Path
) -> None:
    folder = diagnosed(problem, tmp_path / "diagnosed", "base_same_errors.nc")
    (folder / "base.nc").write_bytes(b"not read")
    assert source_of(folder).without_file == "base_same_errors.nc"
    (folder / "base.nc").unlink()
    (folder / "base_same_errors.nc").unlink()
    assert source_of(folder).without is None


def test_the_diagnosis_speaks_against_itself(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the words of the verdict's own statement, before the table, and on the page."""
    folder, out = diagnosed(problem, tmp_path / "diagnosed"), tmp_path / "out"
    influence = {
        "carried_by": ["a<b", "c"],
        "events": [{"event": name} for name in ("a<b", "c", "d")],
        "log_bayes_factor": 29.9,
        "without_them": 3.2,
        "needed": 7.0,
    }
    verdict = {
        "format": 1,
        "verdict": "missing_physics",
        "mechanism": "segment_friction",
        "probability": {"segment_friction": 0.62, "unlisted": 0.06, "obstacle": 0.3},
        "indistinguishable": ["obstacle"],
        "influence": influence,
    }
    write_json(folder / "verdict.json", verdict)
    assert run(["predict", "--from", str(folder), "--out", str(out)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    page = (out / "report.html").read_text(encoding="utf-8")
    check_page(page)
    words = carried(["a<b", "c"], 3, too_little(29.9, 3.2, 7.0))
    assert words.startswith("2 of 3 avalanches carry this answer (a<b and c)")
    for said in (words, "another surface on a stretch 62 %; a force not in the list 6 %", "(30 %)"):
        assert 0 <= told.index(said) < told.index("the next avalanche")
        assert escape(said, quote=False) in page and told.count(said) == 1
    rival = {"id": "obstacle", "ahead": 3.0, "carried_by": ["c"], "without_them": -1.5}
    alarm = {"carried_by": ["a<b", "c"], "without_them": 3.2}
    by_name = influence | {"carried_by": ["c"], "without_them": 12.0, "alarm": alarm, "rival": rival}
    first, second = diagnosis_cautions(verdict | {"influence": by_name})[0].split("; ")
    other = displaced(title_of("obstacle"), 3.0, -1.5)
    assert first == f"Take the diagnosis with care: {carried(['c'], 3, other)}"
    assert second == f"{carried(['a<b', 'c'], 3, too_little(29.9, 3.2, 7.0), 'the alarm')}."
    several = {"error_models": ["robust", "student"], "influence": influence | {"error_model": "student"}}
    under = "(log Bayes factor under student errors 29.9 nats with all, 3.2 without, 7.0 needed)"
    assert under in diagnosis_cautions(verdict | several)[0]
    write_json(folder / "verdict.json", verdict | {"influence": {"carried_by": ["a"]}})
    with pytest.raises(InputError, match="not as skred writes it"):
        source_of(folder)


@pytest.mark.slow
def test_most_do_not_start_is_told_first(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = folder_of(tmp_path / "made", tree_of(problem, "coulomb")), tmp_path / "out"
    words = ["predict", "--from", str(folder), "--out", str(out), "--at", "house=900"]
    assert run([*words, "--track", str(plane(tmp_path, degrees=5.0))]) == 0
    told = " ".join(capsys.readouterr().out.split())
    first = ">99.9 % do not start: friction holds most fronts at the release"
    assert told.index(first) < told.index("the next avalanche") and told.count(first) == 1
    page = (out / "report.html").read_text(encoding="utf-8")
    check_page(page)
    assert page.index("Read this first.") < page.index("In short")
    assert page.count(escape(first)) == 2


@pytest.mark.slow
def test_a_place_above_every_release_is_refused(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = folder_of(tmp_path / "made", tree_of(problem, "coulomb")), tmp_path / "out"
    words = ["predict", "--from", str(folder), "--out", str(out), "--at", "hut=90"]
    assert run([*words, "--release", "100", "--release", "300"]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "--at hut=90: lies above every release, of which the highest is at s = 100.0 m" in told
    assert not out.exists()
    assert run([*words, "--release", "90", "--quiet"]) == 0


@pytest.mark.slow
def test_how_it_was_made_is_on_the_page(problem: HierarchicalProblem, tmp_path: Path) -> None:
    folder, out = folder_of(tmp_path / "made", tree_of(problem, "coulomb")), tmp_path / "out"
    track = plane(tmp_path)
    words = ["predict", "--from", str(folder), "--quiet", "--out", str(out), "--track", str(track)]
    assert run([*words, "--at", "a=900", "--density", "200", "--per-year", "0.2"]) == 0
    document = json.loads((out / "prediction.json").read_text())
    assert document["made"]["seed"] == 3 and document["made"]["command"].startswith("skred")
    page = (out / "report.html").read_text(encoding="utf-8")
    check_page(page)
    digest = hashlib.sha256(track.read_bytes()).hexdigest()
    for said in (
        document["made"]["date"],
        digest,
        "m along the slope,",
        "200 kg/m³ (one value, taken as exact)",
        "the frequency is taken as exact",
        "no document of this track",
    ):
        assert said in page, said
    assert "What was recorded is black" not in page
    assert "density of 200 kg/m3, taken as exact" in " ".join(document["statement"])


def test_that_a_misreading_sensor_comes_closest_to_a_force_in_no_list_is_told() -> None:
    """With such a force a front hardly passes the sensor that in truth reads too little."""
    groups = {"sensor_bias": "instrument", "segment_friction": "physics"}
    verdict = {
        "verdict": "unexplained",
        "probability": {"nothing": 0.0, "unlisted": 0.9, "sensor_bias": 0.07, "segment_friction": 0.03},
        "candidates": [{"id": name, "group": group} for name, group in groups.items()],
    }
    assert "reads too high or too low comes closest" in diagnosis_cautions(verdict)[-1]
    other = {**verdict["probability"], "sensor_bias": 0.01}
    assert not any("comes closest" in one for one in diagnosis_cautions(verdict | {"probability": other}))
