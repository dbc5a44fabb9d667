"""A campaign before it is written: five texts, and for each row of them where it came from."""

import csv
import io
import json
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from skred.campaign import Campaign, CampaignError, Problem, read_campaign
from skred.importing.sheet import Sheet

_ROW = re.compile(r"\b(?:(?P<table>track|sensors|events|recordings)\.csv, )?row (?P<row>\d+)")


@dataclass(frozen=True)
class Where:
    """Where a row of a draft came from.

    Attributes
    ----------
    file : str
    line : int
        Row in the file.
    columns : mapping
        For each column of the draft, the one that it was taken from.
    texts : mapping
        The row's cells as they stand in the file, by its columns.
    others : mapping
        Where columns of the draft came from that another table holds.
    """

    file: str
    line: int
    columns: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    others: Mapping[str, "Where"] = field(default_factory=dict)

    def of(self, column: str | None) -> "Where":
        """Where one column of the draft came from."""
        return self.others.get(column or "", self)


@dataclass(frozen=True)
class DraftTable:
    """One of the four tables as text, numbers with a decimal point, with each row's origin."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Where, dict[str, str]], ...]

    def text(self) -> str:
        """The table as the format has it."""
        written = io.StringIO(newline="")
        writer = csv.writer(written, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([cells.get(column, "") for column in self.columns] for _, cells in self.rows)
        return written.getvalue()


@dataclass(frozen=True)
class Draft:
    """A campaign as five texts.

    Attributes
    ----------
    description : str
        Text of campaign.toml.
    track, sensors, events, recordings : DraftTable
    """

    description: str
    track: DraftTable
    sensors: DraftTable
    events: DraftTable
    recordings: DraftTable

    def texts(self) -> dict[str, str]:
        """The five files by name."""
        return {
            "campaign.toml": self.description,
            "track.csv": self.track.text(),
            "sensors.csv": self.sensors.text(),
            "events.csv": self.events.text(),
            "recordings.csv": self.recordings.text(),
        }

    def check(self) -> Campaign:
        """Read the draft as any campaign is read.

        Raises
        ------
        CampaignError
            With every problem, told by the file, row and column that it came from.
        """
        with tempfile.TemporaryDirectory(prefix="skred-import-") as name:
            folder = Path(name)
            for file, text in self.texts().items():
                (folder / file).write_bytes(text.encode("utf-8", "backslashreplace"))
            try:
                return read_campaign(folder)
            except CampaignError as error:
                # A cell of a wide table is a cell of several of the draft's tables: it is told once.
                raise CampaignError(
                    dict.fromkeys(self._told(problem) for problem in error.problems)
                ) from None

    def _told(self, problem: Problem) -> Problem:
        """A problem of the draft as one of the file that it came from."""
        name = problem.file.removesuffix(".csv")
        table = getattr(self, name, None)
        if not isinstance(table, DraftTable):
            return problem

        def origin(table: str, line: int | None) -> Where | None:
            rows = getattr(self, table).rows
            return rows[line - 2][0] if line is not None and 2 <= line < len(rows) + 2 else None

        def other_row(found: re.Match[str]) -> str:
            there = origin(found["table"] or name, int(found["row"]))
            if there is None:
                return found.group()
            if found["table"] == "events":  # rules on readings speak of an avalanche's release
                there = there.of("release_s_m")
            return f"row {there.line}" if there.file == file else f"{there.file}, row {there.line}"

        where = origin(name, problem.row)
        first = table.rows[0][0] if table.rows else None
        if where is None:
            return problem if first is None else replace(problem, file=first.file)
        where = where.of(problem.column)
        file = where.file
        column, found = problem.column, problem.found
        if column is not None:
            column = where.columns.get(column, column)
            found = where.texts.get(column, found) if found is not None else None
        message = _ROW.sub(other_row, problem.message)
        return Problem(where.file, where.line, column, found, message)


def description_text(values: Mapping[str, str | float | None]) -> str:
    """The text of campaign.toml."""
    lines = ["format = 1"]
    for key, value in values.items():
        if value is not None:
            # A JSON string is a TOML string too, as long as characters outside ASCII stay as they are.
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def with_where(
    sheet: Sheet, rows: Sequence[tuple[int, dict[str, str]]], columns: Mapping[str, str]
) -> tuple[tuple[Where, dict[str, str]], ...]:
    """Rows, one for each of a sheet's, with where they came from."""
    pairs = zip(rows, sheet.rows(), strict=True)
    return tuple((Where(sheet.file, line, columns, texts), cells) for (line, cells), (_, texts) in pairs)
