"""The page of the campaign format: its example is a campaign, and it names and says what the loader does."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from skred.campaign import CampaignError, Status, read_campaign
from skred.campaign.description import Description
from skred.campaign.reading import EVENTS, RECORDINGS, SENSORS, TRACK

PAGE = (Path(__file__).parents[2] / "docs" / "campaign-format.md").read_text(encoding="utf-8")
FILES = ("campaign.toml", "track.csv", "sensors.csv", "events.csv", "recordings.csv")
COLUMNS = {"track.csv": TRACK, "sensors.csv": SENSORS, "events.csv": EVENTS, "recordings.csv": RECORDINGS}
SHOWN = {
    "campaign.toml": ("format = 1", "format = 2"),
    "track.csv": ("130,1077", "60,1077"),
    "sensors.csv": ("relative_sd", "rel_sd"),
    "events.csv": ("8000,-6.0,dry", "8000,-6.0,2"),
    "recordings.csv": ("upper,28.8", "upper,-28.8"),
    "recordings.csv, another": ("1999-02-03,gate", "1999-03-12,gate"),
}
"""What is broken in the example for each message that the page shows, in its order."""


def example() -> dict[str, str]:
    """The five fenced blocks that a file's name introduces."""
    return dict(re.findall(r"^`([a-z]+\.(?:toml|csv))`\n\n```(?:toml|csv)\n(.*?)^```$", PAGE, re.M | re.S))


def section(name: str) -> str:
    """The text under a heading, up to the next of the same rank."""
    found = re.search(rf"^## {re.escape(name)}\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S)
    assert found, name
    return found.group(1)


def write(folder: Path, texts: Mapping[str, str]) -> Path:
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder


def problems(folder: Path, file: str, old: str, new: str) -> list[str]:
    """What the loader says of the example with one text replaced."""
    texts = example()
    assert old in texts[file]
    with pytest.raises(CampaignError) as caught:
        read_campaign(write(folder, texts | {file: texts[file].replace(old, new, 1)}))
    return [str(problem) for problem in caught.value.problems]


def test_the_example_is_a_campaign(tmp_path: Path) -> None:
    texts = example()
    assert tuple(texts) == FILES
    campaign = read_campaign(write(tmp_path, texts))
    assert campaign.n_events >= 6
    assert set(np.unique(campaign.status)) == {status for status in Status if not status.is_bound}
    assert {sensor.is_span for sensor in campaign.sensors} == {True, False}
    assert any(sensor.is_runout for sensor in campaign.sensors)
    kinds = {type(value) for event in campaign.events for value in event.covariates.values()}
    assert {float, str} <= kinds
    assert np.isfinite(campaign.stated_sd).any()
    fall = campaign.track.z_m[0] - campaign.track.z_m[-1]
    assert f"falls {fall:.0f} m" in PAGE


@pytest.mark.parametrize("file", COLUMNS)
def test_every_column_is_in_the_table_of_its_file(file: str) -> None:
    rows = re.findall(r"^\| `(\w+)` \|", section(f"`{file}`"), re.M)
    words = {status.name.lower() for status in Status} if file == "recordings.csv" else set()
    assert set(rows) == {column.name for column in COLUMNS[file]} | words
    for column in COLUMNS[file]:
        row = re.search(rf"^\| `{column.name}` \|.*$", section(f"`{file}`"), re.M)
        assert row and ("optional column" in row.group()) is not column.required


def test_every_key_is_in_the_table_of_campaign_toml() -> None:
    rows = re.findall(r"^\| `(\w+)` \|.*$", section("`campaign.toml`"), re.M)
    assert rows == list(Description.model_fields)


def test_every_status_is_explained() -> None:
    statuses = re.findall(r"^\| `(\w+)` \| [^|]+ \| (?:yes|no)", section("`recordings.csv`"), re.M)
    assert statuses == [status.name.lower() for status in Status]


def test_messages_are_what_the_loader_says(tmp_path: Path) -> None:
    block = re.search(r"^```text\n(.*?)^```$", section("What the loader refuses"), re.M | re.S)
    assert block
    said = []
    for number, (where, (old, new)) in enumerate(SHOWN.items()):
        folder = tmp_path / str(number)
        folder.mkdir()
        said.append(problems(folder, where.partition(",")[0], old, new)[0])
    assert block.group(1).splitlines() == said


def test_the_standard_deviation_is_the_pages(tmp_path: Path) -> None:
    campaign = read_campaign(write(tmp_path, example()))
    sd = campaign.reading_sd()
    sensor = campaign.sensors[0]
    by_sensor = np.sqrt((sensor.relative_sd * campaign.values[0, 0]) ** 2 + sensor.absolute_sd**2)
    assert sd[0, 0] == pytest.approx(by_sensor)
    assert sd[2, 0] == 4.0


def test_the_page_s_rows_with_bounds_are_read(tmp_path: Path) -> None:
    [block] = re.findall(r"^```csv\n(event,sensor,value,value_to.*?)^```$", PAGE, re.M | re.S)
    campaign = read_campaign(write(tmp_path, example() | {"recordings.csv": block}))
    assert {status for status in Status if status.is_bound} <= set(np.unique(campaign.status))


def test_a_missing_row_is_a_missing_reading(tmp_path: Path) -> None:
    texts = example()
    row = "2011-01-09,upper,,,missing\n"
    assert row in texts["recordings.csv"]
    with_row = read_campaign(write(tmp_path, texts))
    texts["recordings.csv"] = texts["recordings.csv"].replace(row, "")
    assert read_campaign(write(tmp_path, texts)).fingerprint() == with_row.fingerprint()
