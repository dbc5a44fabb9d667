"""The page of mechanisms from other packages: its code is installed, listed, compared and named."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.library import GROUP
from skred.physics.mechanisms.spec import BoundTo

TESTS = Path(__file__).parents[1]
PAGE = (TESTS.parent / "docs" / "own-mechanism.md").read_text(encoding="utf-8")
SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))
COMPARED = """
import json
from diagnosis_cases import base_of, first_events, trial, with_sensors
from diagnosis_report_cases import diagnosis
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.detect.detectability import identify
from skred.diagnosis.detect.run import identify_document
from skred.diagnosis.verdict.document import verdict
from skred.output import plain

campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, 6)
base = base_of(with_sensors(campaign, [12, 18, 24, campaign.n_sensors - 1]), "constant")
told = identify_document(base.problem, base.law, identify(base))
found = verdict(diagnosis("wet_snow"))
print(json.dumps(plain({"identify": told, "probability": compare(base).probability, "verdict": found})))
"""
"""On six simulated avalanches: what can be told, and a comparison; and the verdict if the page's is named."""


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


CODE = "".join(blocks("python"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page's package, as an installer leaves it."""
    folder = tmp_path_factory.mktemp("installed")
    project = tomllib.loads("".join(blocks("toml")))["project"]
    ((name, value),) = project["entry-points"][GROUP].items()
    file = folder / Path(*value.partition(":")[0].split(".")).with_suffix(".py")
    file.parent.mkdir()
    file.write_text(CODE, encoding="utf-8")
    metadata = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8"
    )
    (metadata / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {value}\n", encoding="utf-8")
    return folder


def process(folder: Path, *words: str) -> str:
    """What a Python process that finds the package says."""
    path = os.pathsep.join(map(str, (folder, TESTS / "diagnosis", TESTS / "report")))
    done = subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        timeout=1800,
        env=os.environ | {"PYTHONPATH": path},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def compared(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(process(folder, "-c", COMPARED))
    return found


def test_the_command_line_lists_it(folder: Path) -> None:
    listed = json.loads(process(folder, "-m", "skred.cli", "mechanisms", "--json"))
    own = {one["id"]: one for one in listed["mechanisms"]}["wet_snow"]
    assert (own["package"], own["bound_to"], own["group"]) == ("my-snow", "place", "physics")
    assert own["looked_for"].startswith("stretches of 75, 200 or 500 m") and listed["refused"] == []
    assert own["missing_from"] == ["constant", "coulomb", "pcm", "voellmy"]


def test_identify_and_the_comparison_include_it(compared: dict[str, Any]) -> None:
    rows = {row["id"]: row for row in compared["identify"]["identifiability"]}
    assert 0.0 < rows["wet_snow"]["power"] < 1.0 and rows["wet_snow"]["best_stretch_m"] is not None
    probability = compared["probability"]
    assert set(rows) | {"nothing", "unlisted"} == set(probability)
    assert 0.0 < probability["wet_snow"] < 1.0 and sum(probability.values()) == pytest.approx(1.0)


def test_a_verdict_that_names_it_fits_the_schema(compared: dict[str, Any]) -> None:
    document = compared["verdict"]
    assert list(Draft202012Validator(SCHEMA).iter_errors(document)) == []
    assert (document["verdict"], document["mechanism"]) == ("missing_physics", "wet_snow")
    (own,) = document["mechanisms"]
    assert own["bound_to"] == "place" and own["location"] == document["location"] is not None
    assert document["strength"]["parameter"] == "wet_drag" and document["strength"]["unit"] == "s-1"
    assert "wet snow on a stretch between s =" in document["statement"]


@pytest.mark.slow
def test_a_whole_diagnosis_with_it(folder: Path, tmp_path: Path) -> None:
    """On campaigns that everybody has: an answer, a report, and its probability in both."""
    out = tmp_path / "out"
    words = ("diagnose", "--base-model", "pcm", "--quick", "--out", str(out), "--quiet")
    process(folder, "-m", "skred.cli", *words)
    document = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    assert list(Draft202012Validator(SCHEMA).iter_errors(document)) == []
    assert "wet_snow" in document["probability"] and "wet_snow" in document["detection_limits"]
    assert "wet snow on a stretch" in (out / "report.html").read_text(encoding="utf-8")


def test_the_mechanism_takes_under_40_lines_of_code() -> None:
    (docstring, *_) = ast.parse(CODE).body
    lines = CODE.splitlines()[docstring.end_lineno :]
    assert sum(bool(line.strip()) for line in lines) < 40


def test_the_tables_are_complete() -> None:
    assert set(re.findall(r"^\| `BoundTo\.(\w+)` \|", PAGE, re.M)) == {one.name for one in BoundTo}
    columns = PAGE[PAGE.index("| `Column` |") :]
    assert set(re.findall(r"^\| `([A-Z]+)` \|", columns, re.M)) == {one.name for one in Column}
    assert "A new form in U" in PAGE and "needs a change of the kernel" in PAGE
