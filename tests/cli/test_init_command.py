"""`skred init`: a folder that validates, says what its columns are, and is the page's example."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from skred.campaign import read_campaign
from skred.campaign.reading import EVENTS, RECORDINGS, SENSORS, TRACK
from skred.campaign.template import FILES
from skred.cli.main import run

PAGE = (Path(__file__).parents[2] / "docs" / "campaign-format.md").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    assert run(["init", str(tmp_path / "new" / "mine"), "--quiet"]) == 0
    return tmp_path / "new" / "mine"


def test_it_validates(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sorted(file.name for file in folder.iterdir()) == sorted(FILES)
    assert run(["validate", str(folder)]) == 0
    assert "no problems" in capsys.readouterr().out
    assert read_campaign(folder).n_events == 8


def test_it_is_the_example_of_the_page(folder: Path) -> None:
    example = dict(re.findall(r"^`([a-z]+\.(?:toml|csv))`\n\n```(?:toml|csv)\n(.*?)^```$", PAGE, re.M | re.S))
    for file, text in example.items():
        if file.endswith(".csv"):
            assert (folder / file).read_text(encoding="utf-8") == text
    assert (
        tomllib.loads((folder / "campaign.toml").read_text(encoding="utf-8")).keys()
        == tomllib.loads(example["campaign.toml"]).keys()
    )


def test_every_column_and_key_is_explained(folder: Path) -> None:
    text = (folder / "README.txt").read_text(encoding="utf-8")
    for column in (*TRACK, *SENSORS, *EVENTS, *RECORDINGS):
        assert re.search(rf"^    {column.name} ", text, re.M), column.name
    lines = (folder / "campaign.toml").read_text(encoding="utf-8").splitlines()
    keys = [number for number, line in enumerate(lines) if " = " in line and not line.startswith("#")]
    assert all(lines[number - 1].startswith("#") for number in keys)


def test_what_is_there_is_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "events.csv").write_text("mine")
    (folder / "notes.txt").write_text("mine")
    assert run(["init", str(folder)]) == 2
    assert "--force" in capsys.readouterr().err and (folder / "events.csv").read_text() == "mine"
    assert run(["init", str(folder), "--force"]) == 0
    assert read_campaign(folder).n_events == 8 and (folder / "notes.txt").read_text() == "mine"


@pytest.mark.slow
def test_identify_runs_on_it(folder: Path, tmp_path: Path) -> None:
    assert run(["identify", str(folder), "--out", str(tmp_path / "identified"), "--quiet"]) == 0
