"""Tables as people keep them, made for the tests of importing, and `skred` run on them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import openpyxl
import pytest
from small_campaign import TEXTS

from skred.campaign import Campaign, read_campaign
from skred.cli.main import run

TRACK = TEXTS["track.csv"]
"""Arc lengths 0, 100, 200, 267.08, 387.50 m; every altitude once."""
WORDS = {"sensor", "quantity", "event", "status", "snow_type"}
WIDE = [
    ["Date", "v upper [m/s]", "v lower [m/s]", "Runout s [m]", "Volume [m3]", "Snow"],
    ["1999-02-03", "30.5", "10.2", "320.5", "12000", "dry"],
    ["2000-01-21", "20.1", "-", "180", "8000.5", "wet"],
    ["2002-02-27", "", "", ">= 250", "", "dry"],
]
COLUMNS = (
    "v upper [m/s]=front_velocity at=100 unit=m/s sensor=upper",
    "v lower [m/s]=front_velocity at=250 unit=m/s sensor=lower",
)
DECLARED = (
    *"--set velocity.relative_sd=0.1 --set velocity.absolute_sd=1 --set runout.absolute_sd=10".split(),
    *"--set release.s_m=0 --blank missing --dash not_reached --yes --quiet".split(),
)


def options(*columns: str) -> list[str]:
    """Everything that has to be declared of `WIDE`."""
    return [*DECLARED, *(word for column in columns or COLUMNS for word in ("--column", column))]


def skred(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run a command in this process: exit code, stdout, stderr."""
    capsys.readouterr()
    code = run([str(one) for one in arguments])
    said = capsys.readouterr()
    assert "Traceback" not in said.err and "fault of skred" not in said.err, said.err
    return code, said.out, said.err


def written(rows: Sequence[Sequence[str]], separator: str = ",", newline: str = "\n") -> str:
    """Rows as delimited text."""
    text = io.StringIO(newline="")
    csv.writer(text, delimiter=separator, lineterminator=newline).writerows(rows)
    return text.getvalue()


def with_decimal(rows: Sequence[Sequence[str]], decimal: str) -> list[list[str]]:
    """Rows with another decimal sign; dates have no points."""
    return [[cell.replace(".", decimal) for cell in row] for row in rows]


def in_dialect(
    texts: Mapping[str, str],
    folder: Path,
    *,
    separator: str = ";",
    decimal: str = ",",
    encoding: str = "utf-8-sig",
    newline: str = "\r\n",
) -> Path:
    """The five files as another program would save them."""
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        if file == "campaign.toml":
            (folder / file).write_text(text, encoding="utf-8")
            continue
        header, *rows = csv.reader(io.StringIO(text))
        turned = [
            [
                cell if name in WORDS else cell.replace(".", decimal)
                for name, cell in zip(header, row, strict=True)
            ]
            for row in rows
        ]
        (folder / file).write_bytes(written([header, *turned], separator, newline).encode(encoding))
    return folder


def workbook(file: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> Path:
    """A workbook; numbers in it are numbers."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append([as_number(cell) if isinstance(cell, str) else cell for cell in row])
    book.save(file)
    return file


def as_number(text: str) -> object:
    """What a spreadsheet makes of typed text."""
    try:
        return float(text)
    except ValueError:
        return text or None


@pytest.fixture
def track(tmp_path: Path) -> Path:
    """The track's file."""
    file = tmp_path / "profile.csv"
    file.write_text(TRACK)
    return file


def wide_file(
    folder: Path, rows: Sequence[Sequence[str]] = WIDE, name: str = "table.csv", **how: str
) -> Path:
    """A wide table's file."""
    file = folder / name
    file.write_text(written(rows, **how), encoding="utf-8", newline="")
    return file


def without_bounds(rows: Sequence[Sequence[str]] = WIDE) -> list[list[str]]:
    """The same table with every runout observed."""
    return [[cell.removeprefix(">= ") for cell in row] for row in rows]


def same(folder: Path, other: Path | Campaign) -> bool:
    """Whether two campaigns are, but for their descriptions."""
    one, two = read_campaign(folder), other if isinstance(other, Campaign) else read_campaign(other)
    return recorded(one) == recorded(two)


def recorded(campaign: Campaign) -> object:
    """What was recorded."""
    return (
        campaign.track.x_m.tolist(),
        campaign.track.z_m.tolist(),
        [repr(sensor) for sensor in campaign.sensors],
        [repr(event) for event in campaign.events],
        repr(campaign.values.tolist()),
        campaign.status.tolist(),
        repr(campaign.stated_sd.tolist()),
        repr(campaign.values_to.tolist()),
    )
