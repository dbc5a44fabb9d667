"""What recordings can tell, without sampling; `skred identify` and `skred diagnose` as one calls them."""

from __future__ import annotations

import importlib
import io
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.text import Text

from skred.campaign import Campaign, find_campaign, read_campaign, write_campaign
from skred.cli.main import run
from skred.diagnosis.detect.run import (
    base_of,
    identifiability,
    identify_document,
    identify_to,
)
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.detect.too_little import too_little
from skred.diagnosis.effort import QUICK_REPLICAS, Effort
from skred.diagnosis.outcome import NotDiagnosed
from skred.diagnosis.verdict.document import verdict
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law
from skred.report.diagnosis.identify import identify_table
from skred.report.diagnosis.report import diagnosis_table

RYGGFONN = read_campaign(find_campaign("ryggfonn"))


def first_events(n: int) -> Campaign:
    """Ryggfonn's first avalanches."""
    arrays = {name: getattr(RYGGFONN, name)[:n] for name in ("values", "status", "stated_sd")}
    return replace(RYGGFONN, name="[bold]few", events=RYGGFONN.events[:n], **arrays)


def document_of(campaign: Campaign, law_id: str = "pcm") -> dict[str, Any]:
    problem, law = hierarchical_problem(campaign), load_law(law_id)
    return identify_document(problem, law, identifiability(base_of(problem, law)))


def by_id(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {row["id"]: row for row in document["identifiability"]}


@pytest.fixture(scope="module")
def ryggfonn() -> dict[str, Any]:
    return document_of(RYGGFONN)


@pytest.mark.slow
@pytest.mark.parametrize("law_id", ["pcm", "constant", "coulomb", "voellmy"])
def test_a_row_for_whatever_can_be_missing(law_id: str) -> None:
    problem, law = hierarchical_problem(RYGGFONN), load_law(law_id)
    base = base_of(problem, law)
    document = identify_document(problem, law, identifiability(base))
    assert set(by_id(document)) == {candidate.mechanism.id for candidate in placed_mechanisms(base.setting)}
    for row in document["identifiability"]:
        assert 0.0 <= row["kept"] <= 1.0 and 0.0 <= row["power"] <= 1.0
        assert row["limit"] is None or row["limit"] >= row["best_limit"] > 0.0
        assert set(row["alike"]) <= set(by_id(document)) - {row["id"]}
    assert json.loads(json.dumps(document, allow_nan=False)) is not None


def test_what_ryggfonn_can_tell(ryggfonn: dict[str, Any]) -> None:
    """A constant drowns in dry friction, a drag in a drag; what happens at one place does not."""
    rows = by_id(ryggfonn)
    assert rows["constant_retardation"]["kept"] < 0.01 and rows["viscous_drag"]["kept"] < 0.01
    assert rows["sensor_bias"]["kept"] > 0.3
    assert "entrainment" in rows["segment_drag"]["alike"]
    first, last = rows["obstacle"]["best_stretch_m"]
    assert 1600.0 < first < last < 2200.0
    assert ryggfonn["power"] == pytest.approx(
        np.mean([row["power"] for row in rows.values() if row["group"] == "physics"])
    )
    assert ryggfonn["can_tell"] is False
    assert ryggfonn["next_sensor"]["power_with"] > ryggfonn["power"]


def test_nothing_is_told_of_a_release_at_the_end_of_the_track(ryggfonn: dict[str, Any]) -> None:
    row = by_id(ryggfonn)["release_offset"]
    assert row["limit"] is None and row["best_limit"] is None and row["kept"] == 0.0
    assert any("release_offset" in sentence for sentence in ryggfonn["statement"])


def test_better_readings_tell_more(ryggfonn: dict[str, Any]) -> None:
    sensors = tuple(
        replace(one, relative_sd=0.3 * one.relative_sd, absolute_sd=0.3 * one.absolute_sd)
        for one in RYGGFONN.sensors
    )
    better = document_of(replace(RYGGFONN, sensors=sensors, stated_sd=0.3 * RYGGFONN.stated_sd))
    before, after = by_id(ryggfonn), by_id(better)
    seen = [name for name in before if before[name]["best_limit"] is not None]
    lower = [after[name]["best_limit"] < before[name]["best_limit"] for name in seen]
    assert np.mean(lower) > 0.8 and better["power"] > ryggfonn["power"]


def test_nothing_is_random(ryggfonn: dict[str, Any]) -> None:
    assert document_of(RYGGFONN) == ryggfonn


def test_too_few_avalanches(tmp_path: Path) -> None:
    document = identify_to(hierarchical_problem(first_events(5)), load_law("pcm"), tmp_path)
    assert "5 avalanches" in document["reason"] and "5 avalanches" in document["statement"][0]
    assert document["identifiability"] == [] and document["power"] is None
    assert json.loads((tmp_path / "identify.json").read_text()) == document


@pytest.mark.parametrize("name", ["ryggfonn", "[bold]\x1b[31m" + 90 * "x"])
def test_the_table_fits_a_terminal(name: str, ryggfonn: dict[str, Any]) -> None:
    told = io.StringIO()
    document = ryggfonn | {"campaign": ryggfonn["campaign"] | {"name": name}}
    Console(width=80, file=told).print(identify_table(document))
    text = told.getvalue()
    assert all(row["id"] in text for row in document["identifiability"])
    assert name[:6] in text and "\x1b" not in text and "s [m]" in text and "readings fit." in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a command runs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("NO_COLOR", "1")
    return tmp_path


def test_the_command(folder: Path, capsys: pytest.CaptureFixture[str], ryggfonn: dict[str, Any]) -> None:
    assert run(["identify", "--out", "told"]) == 0
    told = capsys.readouterr()
    assert "segment_drag" in told.out and "written: told" in told.out
    assert "pcm: fitting" in told.err
    plain = json.loads(json.dumps(ryggfonn))
    assert json.loads((folder / "told" / "identify.json").read_text()) == plain
    assert [file.name for file in (folder / "told").glob("[!.]*")] == ["identify.json"]
    assert run(["identify", "--out", "told"]) == 2
    assert "--force" in capsys.readouterr().err
    assert run(["identify", "--out", "told", "--force", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == plain and told.err == ""
    assert run(["identify", "--quiet", "--seed", "5"]) == 0
    assert capsys.readouterr() == ("", "")
    (fresh,) = (folder / "skred-out").iterdir()
    assert fresh.name.startswith("identify-")
    assert json.loads((fresh / "identify.json").read_text()) == plain


def test_the_command_on_too_few_avalanches(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_campaign(first_events(5), folder / "few")
    """An answer before anything is fitted: the recordings cannot tell, and what would help."""
    assert run(["identify", "few", "--out", "told"]) == 0
    out = capsys.readouterr().out
    assert "cannot tell: only 5 avalanches" in " ".join(out.split()) and "[bold]few" in out
    reason = json.loads((folder / "told" / "identify.json").read_text())["reason"]
    assert reason.startswith("only 5") and reason.endswith("record 1 more avalanche")


def runouts_only(campaign: Campaign) -> Campaign:
    """Nothing but where avalanches stopped."""
    kept = [k for k, sensor in enumerate(campaign.sensors) if sensor.is_runout]
    arrays = {name: getattr(campaign, name)[:, kept] for name in ("values", "status", "stated_sd")}
    return replace(campaign, sensors=tuple(campaign.sensors[k] for k in kept), **arrays)


@pytest.mark.parametrize(
    ("campaign", "have", "more"),
    [
        (first_events(3), "only 3 avalanches have a reading", "record 3 more avalanches"),
        (runouts_only(RYGGFONN), "only 1 sensor has readings", "record front speeds at a place"),
    ],
    ids=["three avalanches", "runouts only"],
)
def test_too_few_recordings_are_an_answer_before_anything_is_sampled(
    campaign: Campaign, have: str, more: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    write_campaign(campaign, folder / "few")
    assert run(["diagnose", "few", "--quiet", "--out", "told"]) == 0
    document = json.loads((folder / "told" / "verdict.json").read_text())
    assert document["verdict"] == "cannot_tell" and document["converged"] is True
    assert document["reason"].startswith(have) and more in document["statement"]
    assert document["seconds"] == {}, "a stage was begun"
    assert run(["identify", "few", "--quiet", "--out", "identified"]) == 0
    assert json.loads((folder / "identified" / "identify.json").read_text())["reason"] == document["reason"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt, 130, "interrupted; what was finished is in {left}"),
        (OSError, 2, "what was finished is in {left}"),
        (ZeroDivisionError, 3, "the traceback is in {left}/traceback.txt"),
    ],
)
@pytest.mark.parametrize(
    ("command", "module", "function", "file"),
    [
        ("identify", "skred.diagnosis.detect.run", "identify_to", "identify.json"),
        ("diagnose", "skred.diagnosis.run", "diagnose_to", "verdict.json"),
        ("predict", "skred.prediction.predict", "predict", "predict.json"),
        ("compare", "skred.model_selection.compare", "compare", "compare.json"),
    ],
)
def test_a_command_that_breaks_off_leaves_earlier_results(
    command: str,
    module: str,
    function: str,
    file: str,
    error: type[BaseException],
    code: int,
    said: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And says where what it had written is: a verdict is not lost because a figure cannot be drawn."""
    (folder / "out").mkdir()
    (folder / "out" / file).write_text("earlier")

    def breaks_off(*given: Any, **more: Any) -> None:
        (where,) = (one for one in given if isinstance(one, Path))
        (where / file).write_text("new")
        raise error

    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # no helpers: they would start for nothing
    monkeypatch.setattr(importlib.import_module(module), function, breaks_off)
    assert run([command, "--out", "out", "--force", "--quiet"]) == code
    left = Path("out") / ".skred-unfinished"
    assert said.format(left=left) in capsys.readouterr().err
    assert (folder / "out" / file).read_text() == "earlier" and (left / file).read_text() == "new"


BAD = [
    ["--base-model", "bingham"],
    ["--errors", "gauss"],
    ["--seed", "-1"],
    ["--smoothing", "-3"],
    ["--no-such-option"],
    ["nowhere"],
    ["ryggfonn", "stray"],
]


@pytest.mark.parametrize("words", BAD, ids=" ".join)
@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_bad_words_are_told(
    command: str, words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([command, *words]) == 2
    told = capsys.readouterr()
    assert told.err.strip() and told.out == ""
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    "words", [["--max-mechanisms", "0"], ["--max-mechanisms", "3"], ["--draws", "9"]], ids=" ".join
)
def test_bad_efforts_are_told(words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose", *words]) == 2
    assert words[0] in capsys.readouterr().err
    assert list(folder.iterdir()) == []


Diagnosed = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> Diagnosed:
    """Diagnoses made up instead of computed; what they were asked for is kept."""
    import skred.diagnosis.run as module

    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # no helpers: they would start for nothing
    asked: list[dict[str, Any]] = []

    def with_reason(reason: str | None, converged: bool = True) -> list[dict[str, Any]]:
        def made_up(
            problem: Any, law: Any, settings: Any, effort: Any, folder: Any, tell: Any, **more: Any
        ) -> Any:
            tell("a stage")
            asked.append({"problem": problem, "law": law, "settings": settings, "effort": effort, **more})
            document = {"verdict": "cannot_tell", "reason": reason, "converged": converged}
            return document | {"statement": "What [it] says."}

        monkeypatch.setattr(module, "diagnose_to", made_up)
        monkeypatch.setattr("skred.report.folders.write_reports", lambda folder: [])
        return asked

    report = ModuleType("skred.report.diagnosis.report")
    report.diagnosis_table = lambda document: Text(document["statement"])  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "skred.report.diagnosis.report", report)
    return with_reason


def test_a_diagnosis_is_told_with_its_statement() -> None:
    problem = hierarchical_problem(first_events(5))
    document = verdict(NotDiagnosed(problem, load_law("pcm"), too_little(problem)))
    told = io.StringIO()
    Console(width=80, file=told).print(diagnosis_table(document))
    assert " ".join(told.getvalue().split()).count(document["statement"]) == 1


@pytest.mark.parametrize(
    ("reason", "converged", "code"),
    [(None, True, 0), ("the gate failed", False, 1), ("too few avalanches", True, 0), (None, False, 0)],
)
def test_what_a_diagnosis_ends_with(
    reason: str | None,
    converged: bool,
    code: int,
    folder: Path,
    diagnosed: Diagnosed,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A verdict of which a refit did not converge is an answer, and says so."""
    diagnosed(reason, converged)
    assert run(["diagnose", "--out", "told"]) == code
    told = capsys.readouterr()
    assert told.err == "a stage\nwriting the report\n"
    assert told.out == "What [it] says.\n\nwritten: told\n"
    assert run(["diagnose", "--json"]) == code
    told = capsys.readouterr()
    assert json.loads(told.out)["reason"] == reason and told.err == ""
    assert run(["diagnose", "--quiet"]) == code
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], (Effort().replicas, 2, False)),
        (["--quick"], (QUICK_REPLICAS, 1, False)),
        (["--quick", "--max-mechanisms", "2"], (QUICK_REPLICAS, 2, False)),
        (["--max-mechanisms", "1", "--exact-loo"], (Effort().replicas, 1, True)),
    ],
)
def test_how_much_is_computed(
    words: list[str], expected: tuple[int, int, bool], folder: Path, diagnosed: Diagnosed
) -> None:
    asked = diagnosed(None)
    assert run(["diagnose", *words]) == 0
    effort = asked[0]["effort"]
    assert (effort.replicas, effort.max_mechanisms, effort.exact_loo) == expected


def test_what_a_diagnosis_is_asked(folder: Path, diagnosed: Diagnosed) -> None:
    asked = diagnosed(None)
    words = ["diagnose", "ryggfonn-with-dam", "--base-model", "constant", "--seed", "7"]
    assert run([*words, "--smoothing", "20", "--errors", "student"]) == 0
    (one,) = asked
    problem, settings = one["problem"], one["settings"]
    assert problem.campaign.name == "ryggfonn-with-dam" and problem.likelihood == "hierarchical"
    assert problem.terrain.smoothing_m == 20.0 and problem.error_model.id == "student"
    assert one["law"].id == "constant"
    assert (settings.sampler, settings.seed, settings.draws, settings.tune) == ("metropolis", 7, 600, 1000)
