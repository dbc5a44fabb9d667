"""What recordings can tell, without sampling; `skred identify` and `skred diagnose` as one calls them."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from skred.campaign import Campaign, find_campaign, read_campaign, write_campaign
from skred.cli.main import app, run
from skred.cli.options import DIAGNOSING
from skred.diagnosis.augment.problem import as_diagnosed
from skred.diagnosis.detect.detectability import identify
from skred.diagnosis.detect.run import base_of, identify_document, identify_to
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.effort import SAMPLING, Effort
from skred.inference.calibrate import calibrate
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law
from skred.report.diagnosis.identify import identify_table

RYGGFONN = read_campaign(find_campaign("ryggfonn"))


def first_events(n: int) -> Campaign:
    """Ryggfonn's first avalanches."""
    arrays = {name: getattr(RYGGFONN, name)[:n] for name in ("values", "status", "stated_sd")}
    return replace(RYGGFONN, name="[bold]few", events=RYGGFONN.events[:n], **arrays)


def document_of(campaign: Campaign, law_id: str = "pcm") -> dict[str, Any]:
    problem, law = hierarchical_problem(campaign), load_law(law_id)
    return identify_document(problem, law, identify(base_of(problem, law)))


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
    document = identify_document(problem, law, identify(base))
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
    table = identify_table(document)
    assert len(table.columns) == 8  # a cell too many would make a column without a heading
    Console(width=80, file=told).print(table)
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


CALLED = """
import signal
from skred.cli.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a terminal, however the tests were started
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["identify", "diagnose", "predict", "compare"])
def test_a_command_that_is_interrupted_leaves_earlier_results(command: str, folder: Path) -> None:
    """By Ctrl-C as soon as it tells of its first stage; it was about to write elsewhere."""
    out = folder / "out"
    out.mkdir()
    (out / f"{command}.json").write_text("earlier")
    with subprocess.Popen(
        [sys.executable, "-c", CALLED, command, "--out", "out", "--force"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    ) as process:
        assert process.stderr is not None
        stage = process.stderr.readline()
        assert "pcm" in stage or command == "compare", stage
        assert (out / ".skred-unfinished").is_dir()
        process.send_signal(signal.SIGINT)
        told = process.stderr.read()
    assert process.returncode == 130 and told.splitlines()[-1] == "interrupted", told
    assert "Traceback" not in told
    assert [file.name for file in out.iterdir() if file.is_dir()] == []
    assert (out / f"{command}.json").read_text() == "earlier"


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_diagnosis_that_is_ended_leaves_no_process_and_no_semaphore(
    number: signal.Signals, code: int, folder: Path
) -> None:
    """In the midst of the comparison, which has worker processes."""
    with subprocess.Popen(
        [sys.executable, "-c", CALLED, "diagnose", "--out", "out"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "2"},
        start_new_session=True,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("what could be missing"):
                break
        time.sleep(3.0)
        process.send_signal(number)
        told = process.stderr.read()
    assert process.returncode == code, told
    assert "Traceback" not in told and "leaked" not in told
    assert not (folder / "out").exists() or list((folder / "out").iterdir()) == []
    for _ in range(20):  # the resource tracker ends once its last client has
        time.sleep(0.25)
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
    pytest.fail("something of the diagnosis still runs")


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


@pytest.fixture
def few(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a campaign of five avalanches: too few, so that their diagnosis ends at once."""
    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # no helpers: they would start for nothing
    write_campaign(first_events(5), folder / "few")
    return folder


def test_a_diagnosis_is_told_with_its_statement(few: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose", "few", "--out", "told"]) == 0
    told = capsys.readouterr()
    assert told.err == "writing the report\n"
    document = json.loads((few / "told" / "verdict.json").read_text())
    assert " ".join(told.out.split()).count(document["statement"]) == 1
    assert "[bold]few" in told.out and told.out.endswith("\n\nwritten: told/report.html\n")
    assert (few / "told" / "report.html").is_file()
    assert run(["diagnose", "few", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == document and told.err == ""
    assert run(["diagnose", "few", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], Effort()),
        (["--quick"], Effort(1)),
        (["--quick", "--max-mechanisms", "2"], Effort(2)),
        (["--max-mechanisms", "1", "--exact-loo"], Effort(1, exact_loo=True)),
    ],
)
def test_how_much_is_computed(words: list[str], expected: Effort, few: Path) -> None:
    _, given, _ = app.parse_args(["diagnose", "few", *words])
    assert given.arguments.get("diagnosing", DIAGNOSING).effort() == expected
    assert run(["diagnose", "few", *words, "--out", "told", "--quiet"]) == 0


@pytest.mark.slow
def test_what_a_diagnosis_is_asked(folder: Path) -> None:
    """The base law's draws are those of a calibration with the same law, errors, terrain and seed."""
    campaign = first_events(8)
    write_campaign(campaign, folder / "eight")
    words = ["diagnose", "eight", "--base-model", "constant", "--seed", "7", "--quick"]
    assert run([*words, "--smoothing", "20", "--errors", "student", "--out", "told", "--quiet"]) == 0
    document = json.loads((folder / "told" / "verdict.json").read_text())
    settings = replace(SAMPLING, seed=7)
    assert document["base_model"] == "constant"
    assert document["settings"] == settings.as_dict()
    problem = as_diagnosed(hierarchical_problem(campaign, error_model="student", smoothing_m=20.0))
    draws = calibrate(problem, load_law("constant"), settings).tree["posterior"]["retardation"]
    with xr.open_datatree(folder / "told" / "base.nc", engine="h5netcdf") as written:
        assert written.attrs["campaign_fingerprint"] == campaign.fingerprint()
        np.testing.assert_allclose(written["posterior"]["retardation"], draws, rtol=1e-10)
