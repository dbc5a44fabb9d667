"""A campaign before it is written: five texts, and for each row of them where it came from."""

import csv
import io
import json
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from skred.campaign import Campaign, CampaignError, Problem, Status, read_campaign
from skred.importing.readings import OBSERVED, STATUSES
from skred.importing.sheet import Sheet

_ROW = re.compile(r"\brow (\d+)")


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
    """

    file: str
    line: int
    columns: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)


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

    def with_status(self, old: frozenset[str], new: str) -> "DraftTable":
        """The table with some statuses written as another."""
        rows = tuple(
            (where, {**cells, "status": new if cells.get("status") in old else cells.get("status", "")})
            for where, cells in self.rows
        )
        return replace(self, rows=rows)


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
        return self._texts(self.recordings)

    def check(self) -> Campaign:
        """Read the draft as any campaign is read.

        Statuses that this version's reader does not know yet are checked as observed ones, which have the
        same rules.

        Raises
        ------
        CampaignError
            With every problem, told by the file, row and column that it came from.
        """
        known = {status.name.lower() for status in Status}
        unknown = frozenset(STATUSES) - known
        texts = self._texts(self.recordings.with_status(unknown, OBSERVED))
        with tempfile.TemporaryDirectory(prefix="skred-import-") as name:
            folder = Path(name)
            for file, text in texts.items():
                (folder / file).write_bytes(text.encode("utf-8", "backslashreplace"))
            try:
                return read_campaign(folder)
            except CampaignError as error:
                raise CampaignError([self._told(problem) for problem in error.problems]) from None

    def _texts(self, recordings: DraftTable) -> dict[str, str]:
        return {
            "campaign.toml": self.description,
            "track.csv": self.track.text(),
            "sensors.csv": self.sensors.text(),
            "events.csv": self.events.text(),
            "recordings.csv": recordings.text(),
        }

    def _told(self, problem: Problem) -> Problem:
        """A problem of the draft as one of the file that it came from."""
        table = getattr(self, problem.file.removesuffix(".csv"), None)
        if not isinstance(table, DraftTable):
            return problem

        def origin(line: int | None) -> Where | None:
            return table.rows[line - 2][0] if line is not None and 2 <= line < len(table.rows) + 2 else None

        def other_row(found: re.Match[str]) -> str:
            there = origin(int(found.group(1)))
            return found.group() if there is None else f"row {there.line}"

        where = origin(problem.row)
        first = table.rows[0][0] if table.rows else None
        if where is None:
            return problem if first is None else replace(problem, file=first.file)
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
