"""What was understood of the tables, to be looked at before anything is written."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from skred.campaign.cells import has_unit
from skred.campaign.problems import shown
from skred.importing.column_meaning import Meaning, sensor_id
from skred.importing.draft import Draft, DraftTable
from skred.importing.mapping import Column
from skred.importing.numbers import Notation
from skred.importing.readings import AT_LEAST, AT_MOST, BETWEEN, OBSERVED
from skred.importing.sheet import Sheet

if TYPE_CHECKING:
    from rich.console import Group

PREVIEWED_EVENTS = 3


@dataclass(frozen=True)
class ShownColumn:
    """One column as it was understood.

    Attributes
    ----------
    file, column, meaning, unit : str
    cells : int
        So many are not blank.
    declared : bool
        False where only the column's name says what it is.
    declaration : str
        The option that declares it.
    """

    file: str
    column: str
    meaning: str
    unit: str
    cells: int
    declared: bool
    declaration: str = "--column 'NAME=MEANING'"


@dataclass(frozen=True)
class Understanding:
    """Everything that is shown before it is written.

    Attributes
    ----------
    files : tuple of (str, str)
        Each file and how it is written.
    columns : tuple of ShownColumn
    preview : tuple of mapping
        The first avalanches: event, release and readings as they will be written.
    several : bool
        Whether there are several wide tables, whose columns are told apart by their files.
    """

    files: tuple[tuple[str, str], ...]
    columns: tuple[ShownColumn, ...]
    preview: tuple[Mapping[str, str], ...]
    several: bool = False

    @property
    def guessed(self) -> tuple[ShownColumn, ...]:
        """Columns that nobody declared."""
        return tuple(column for column in self.columns if not column.declared)

    def as_dict(self) -> dict[str, Any]:
        """As plain data, for JSON."""
        return {
            "files": [{"file": file, "written": written} for file, written in self.files],
            "columns": [asdict(column) for column in self.columns],
            "preview": [dict(row) for row in self.preview],
        }

    def tables(self) -> "Group":
        """As tables for a terminal."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        files = Table("file", "written in", box=None, title="Files", title_justify="left")
        for one in self.files:
            files.add_row(*(Text(shown(text)) for text in one))
        columns = Table(box=None, title="Columns", title_justify="left")
        for head in (*(("file",) if self.several else ()), "column", "is", "unit", "cells", ""):
            columns.add_column(head, justify="right" if head == "cells" else "left")
        for column in self.columns:
            texts: tuple[str, ...] = (column.column, column.meaning, column.unit, str(column.cells))
            note = "" if column.declared else "taken from its name"
            # Text, because names come from a file and may look like rich's markup.
            texts = (column.file, *texts) if self.several else texts
            columns.add_row(*(Text(shown(text, 80)) for text in texts), Text(note))
        heads = list(dict.fromkeys(key for row in self.preview for key in row))
        preview = Table(box=None, title="The first avalanches, as they will be written", title_justify="left")
        for head in heads:
            preview.add_column(Text(shown(head)))
        for row in self.preview:
            preview.add_row(*(Text(shown(row.get(head, ""))) for head in heads))
        return Group(files, Text(), columns, Text(), preview)


def how_written(sheet: Sheet, notation: Notation) -> tuple[str, str]:
    """A file and how it is written."""
    return sheet.file, f"{sheet.written}, {notation}, {len(sheet.lines)} rows"


def filled(sheet: Sheet, name: str) -> int:
    """How many cells of a column are not blank."""
    return sum(bool(text) for _, text in sheet.cells(name))


def wide_columns_shown(sheet: Sheet, meanings: Mapping[str, Meaning]) -> tuple[ShownColumn, ...]:
    """The columns of a wide table."""
    return tuple(
        ShownColumn(sheet.file, name, *_in_words(name, one.column), filled(sheet, name), one.declared)
        for name, one in meanings.items()
    )


def _in_words(name: str, column: Column) -> tuple[str, str]:
    """What a column is, and its unit."""
    places = {"s": "arc length s", "x": "horizontal distance x", "altitude": "altitude on the track"}
    places["reference"] = "distance from the reference"
    where = places.get(column.place or "", "")
    bound = "" if column.bound is None else f" ({column.bound.replace('_', ' ')})"
    if column.is_ == "front_velocity":
        kind = {"s": "s", "x": "x", "altitude": "altitude", "reference": "reference +"}[column.place or "s"]
        at = f"{column.at:g}" if column.at is not None else f"{column.from_:g} to {column.to:g}"
        sd = f"sd {_sd(column)}"
        return (
            f"front velocity{bound}, sensor {sensor_id(name, column)} at {kind} = {at} m, {sd} m/s",
            column.unit or "m/s",
        )
    if column.is_ == "runout":
        return (
            f"runout{bound} as {where}, sensor {sensor_id(name, column)}, sd {_sd(column)} m along the track",
            (column.unit or "m"),
        )
    if column.is_ == "covariate":
        unit = str(column.name).rpartition("_")[2] if has_unit(column.name or "") else "words"
        return f"covariate {column.name}", unit
    simple = {
        "event": ("the avalanche's id", ""),
        "release": (f"release as {where}", "m"),
        "release_sd": ("standard deviation of the release", "m"),
        "sd": (f"standard deviation of each reading of {column.of}", column.unit or ""),
        "ignore": ("left out", ""),
    }
    return simple[column.is_]


def _sd(column: Column) -> str:
    """Standard deviation of a sensor in words."""
    relative, absolute = column.relative_sd or 0.0, column.absolute_sd or 0.0
    return f"{100 * relative:g} % and {absolute:g}" if relative else f"{absolute:g}"


def preview_of(draft: Draft) -> tuple[Mapping[str, str], ...]:
    """The first avalanches: event, release, readings."""
    rows = []
    for _, event in draft.events.rows[:PREVIEWED_EVENTS]:
        row = {"event": event.get("event", ""), "release s [m]": _short(event.get("release_s_m", ""))}
        for sensor in _sensors(draft.sensors):
            row[sensor] = "missing"
        for _, reading in draft.recordings.rows:
            if reading.get("event") == event.get("event"):
                row[reading.get("sensor", "")] = _reading(reading)
        rows.append(row)
    return tuple(rows)


def _sensors(table: DraftTable) -> Iterable[str]:
    return (row.get("sensor", "") for _, row in table.rows)


def _reading(row: Mapping[str, str]) -> str:
    """A reading in a word."""
    status = row.get("status", "")
    if status not in (OBSERVED, AT_LEAST, AT_MOST, BETWEEN):
        return status.replace("_", " ")
    bound = {AT_LEAST: "at least ", AT_MOST: "at most "}.get(status, "")
    sd = f" ± {_short(row['sd'])}" if row.get("sd") else ""
    to = f" to {_short(row.get('value_to', ''))}" if status == BETWEEN else ""
    return f"{bound}{_short(row.get('value', ''))}{to}{sd}"


def _short(text: str) -> str:
    """A number with the digits that a person reads."""
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return text
