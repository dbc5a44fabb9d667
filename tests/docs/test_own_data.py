"""The page from a spreadsheet to a verdict: its files import as it says, its messages are real."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from skred.campaign import read_campaign
from skred.cli.main import run
from skred.importing.mapping import Column

PAGE = (Path(__file__).parents[2] / "docs" / "own-data.md").read_text(encoding="utf-8")
IMPORTS = [line for line in re.findall(r"^skred (import avalanches.*)$", PAGE, re.M)]
ERRORS = re.findall(r"^error: .*?(?=^```)", PAGE, re.M | re.S)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The page's three tables, in the working directory."""
    for name, text in re.findall(r"^`([a-z]+\.csv)` .*?```csv\n(.*?)^```$", PAGE, re.M | re.S):
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    return tmp_path


def test_messages_are_what_the_program_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(ERRORS) == 2
    for more, told in zip(([], ["--set", "release.place=s"]), ERRORS, strict=True):
        assert run([*shlex.split(IMPORTS[0]), *more]) == 2
        assert capsys.readouterr().err == told


def test_the_import_is_what_the_page_shows(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = shlex.split(IMPORTS[-1])
    assert "--out" in command and run([*command, "--yes"]) == 0
    said = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    shown = re.search(r"^```text\n( column .*?)^```", PAGE, re.M | re.S)
    assert shown
    for line in shown.group(1).splitlines():
        assert line.strip() in ("...",) or " ".join(line.split()) in said, line
    campaign = read_campaign(folder / "my-campaign")
    assert (campaign.n_events, campaign.n_sensors) == (8, 4)
    assert run(["validate", "my-campaign"]) == 0
    table = (folder / "avalanches.csv").read_text(encoding="utf-8").splitlines()
    (folder / "more.csv").write_text("\n".join(table[:4]), encoding="utf-8")
    following = re.search(r"^skred (import more.*)$", PAGE, re.M)
    assert following and run(shlex.split(following.group(1))) == 0
    assert read_campaign(folder / "my-second-campaign").n_events == 3


@pytest.mark.slow
def test_the_verdict_is_what_the_page_shows(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*shlex.split(IMPORTS[-1]), "--yes", "--quiet"]) == 0
    assert run(["diagnose", "my-campaign", "--quick", "--out", "diagnosed"]) == 0
    said = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    shown = re.search(r"with `--quick`:\n\n```text\n(.*?)^```", PAGE, re.M | re.S)
    assert shown
    for line in shown.group(1).splitlines():
        assert " ".join(line.split()) in said, line


def test_every_meaning_and_key_of_a_column_is_explained() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.M))
    kinds = Column.model_json_schema()["properties"]["is"]["enum"]
    assert set(kinds) <= set(rows)
    told = " ".join(rows[kind] for kind in kinds)
    for key in set(Column.model_json_schema()["properties"]) - {"is"}:
        assert f"`{key}=" in told, key
