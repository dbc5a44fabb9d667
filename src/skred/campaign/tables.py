"""A stranger's file turned into rows of text, whatever it holds.

Files are bounded in size, must lie in the campaign's folder and are read as text: each cell is interpreted
by its column (`skred.campaign.cells`). Every failure is a `Problem`.
"""

import csv
import io
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from skred.campaign.cells import LONGEST_WORD, CellError
from skred.campaign.problems import Problem

LARGEST_FILE_BYTES = 20_000_000
MOST_ROWS = 250_000
MOST_LINES = 2 * MOST_ROWS
MOST_COLUMNS = 200
# Checking a file stops here: nobody reads more, and a hostile file should not fill the memory.
MOST_PROBLEMS = 1000
FEWEST_OF_A_COLUMN = 3
"""Cells that must be wrong alike for the column to be what is wrong."""

OTHER_SEPARATOR = (
    "columns are separated by semicolons or tabs, as a spreadsheet with decimal commas saves them; this reads"
    " them as they are: skred import FOLDER --out NEW-FOLDER"
)
"""What is said of a table that needs an import; of several, once."""

Value = float | str | None
ReadCell = Callable[[str], Value]


@dataclass(frozen=True)
class Column:
    """A column of one of the format's tables."""

    name: str
    read: ReadCell
    required: bool = True


@dataclass(frozen=True)
class Row:
    """A row of a table; cells that could not be read are left out."""

    line: int
    cells: Mapping[str, Value]
    unreadable: frozenset[str]

    def has(self, *columns: str) -> bool:
        """Tell whether all these cells could be read (an optional one may hold None)."""
        return all(column in self.cells for column in columns)

    def number(self, column: str) -> float:
        """Return a cell that holds a number."""
        value = self.cells[column]
        assert isinstance(value, float)
        return value

    def number_or_none(self, column: str) -> float | None:
        """Return a cell that may hold a number; None too where the table has no such column."""
        value = self.cells.get(column)
        assert value is None or isinstance(value, float)
        return value

    def word(self, column: str) -> str:
        """Return a cell that holds text."""
        value = self.cells[column]
        assert isinstance(value, str)
        return value


@dataclass(frozen=True)
class Table:
    """A table as far as it could be read.

    Parameters
    ----------
    columns : tuple of str
        The header; empty where the table could not be read to its end, and then there are no rows.
    rows : tuple of Row
        Rows in the file's order.
    problems : tuple of Problem
        Everything that is wrong with the file by itself.
    """

    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    problems: tuple[Problem, ...]

    @property
    def is_usable(self) -> bool:
        """Whether the table was read to its end."""
        return bool(self.columns)


def read_text(folder: Path, file: str, largest_bytes: int | None = None) -> str | Problem:
    """Read one file of a campaign's folder as text.

    Parameters
    ----------
    folder : Path
        The campaign's folder.
    file : str
        The file's name.
    largest_bytes : int, optional
        A longer file is refused; by default `LARGEST_FILE_BYTES`.

    Returns
    -------
    str or Problem
        The text without a byte order mark, or why there is none.
    """
    largest_bytes = LARGEST_FILE_BYTES if largest_bytes is None else largest_bytes

    def refuse(message: str) -> Problem:
        return Problem(file, None, None, None, message)

    try:
        path = (folder / file).resolve(strict=True)
        if not path.is_relative_to(folder.resolve(strict=True)):
            return refuse("the file is a link that leads out of the folder; put a copy in its place")
        if not stat.S_ISREG(path.stat().st_mode):
            return refuse("expected an ordinary file; put one in its place")
        with path.open("rb") as opened:
            raw = opened.read(largest_bytes + 1)
    except FileNotFoundError:
        return refuse("the file is missing; a campaign is five files: add it")
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        return refuse(f"the file cannot be opened ({reason or 'links that lead in a circle'}); check it")
    if len(raw) > largest_bytes:
        return refuse(f"the file is larger than {largest_bytes / 1e6:g} MB; shorten it or split the campaign")
    return _decoded(raw, file)


def _decoded(raw: bytes, file: str) -> str | Problem:
    """Decode UTF-8, with or without a byte order mark."""
    if b"\0" in raw:
        row = raw[: raw.index(b"\0")].count(b"\n") + 1
        return Problem(file, row, None, None, "the file holds NUL bytes; save it as plain text in UTF-8")
    try:
        text = raw.decode("utf-8").lstrip("\ufeff")  # some programs write the byte order mark twice
    except UnicodeDecodeError as error:
        row = error.object[: error.start].count(b"\n") + 1
        found = f"byte 0x{error.object[error.start]:02x}"
        return Problem(file, row, None, found, "the text is not UTF-8; save the file in that encoding")
    if not text.strip():
        return Problem(file, None, None, None, "the file is empty; write its header and rows")
    return text


def read_table(
    folder: Path, file: str, columns: tuple[Column, ...], read_extra: Callable[[str], ReadCell] | None = None
) -> Table:
    """Read one table of a campaign.

    Parameters
    ----------
    folder : Path
        The campaign's folder.
    file : str
        The file's name.
    columns : tuple of Column
        The columns that the format gives this table.
    read_extra : callable, optional
        How to read a further column of that name; without it, further columns are errors.

    Returns
    -------
    Table
        Rows and problems.
    """
    text = read_text(folder, file)
    if isinstance(text, Problem):
        return Table((), (), (text,))
    lines = _split(text)
    try:
        line, header = next(lines)
    except _CsvError as error:
        return Table((), (), (error.problem(file),))
    problems = _header_problems(file, line, header, columns, extra_allowed=read_extra is not None)
    if problems:
        return Table((), (), tuple(problems))
    known = {column.name: column.read for column in columns}
    readers = {
        name: known[name] if name in known or read_extra is None else read_extra(name) for name in header
    }
    rows, problems, is_complete = _read_rows(file, lines, readers)
    problems = _by_column(problems, rows, line)
    if not is_complete:
        # Ids in the part that was not read would look unknown to the other tables.
        return Table((), (), tuple(problems))
    return Table(tuple(header), tuple(rows), tuple(problems))


class _CsvError(ValueError):
    """Text that is not a table at all."""

    def __init__(self, line: int, reason: str) -> None:
        self.line = line
        super().__init__(reason)

    def problem(self, file: str) -> Problem:
        """Return the error as a problem of that file."""
        message = f"the rows from here on cannot be read ({self}); correct them"
        return Problem(file, self.line, None, None, message)


def _split(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield each row's first line number and its cells without surrounding blanks, but no empty rows."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, skipinitialspace=True)
    last_line = 0
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield last_line + 1, [cell.strip() for cell in cells]
            last_line = reader.line_num
            if last_line > MOST_LINES:
                raise _CsvError(last_line, f"the table has more than {MOST_LINES} lines")
    except csv.Error as error:
        raise _CsvError(last_line + 1, str(error)) from None


def _header_problems(
    file: str, line: int, header: list[str], columns: tuple[Column, ...], *, extra_allowed: bool
) -> list[Problem]:
    """Compare a header with the format."""
    known = [column.name for column in columns]
    problems = []
    if len(header) == 1 and (";" in header[0] or "\t" in header[0]):
        return [Problem(file, line, None, header[0], OTHER_SEPARATOR)]
    if len(header) > MOST_COLUMNS:
        message = f"found {len(header)} columns, at most {MOST_COLUMNS} are read; remove some"
        return [Problem(file, line, None, None, message)]
    for position, name in enumerate(header):
        if name == "":
            message = f"column {position + 1} has no name; name it or remove it"
        elif not name.isprintable() or len(name) > LONGEST_WORD:
            message = f"expected a printable name of at most {LONGEST_WORD} characters; rename the column"
        elif name in header[:position]:
            message = "the column appears twice; remove or rename one"
        elif _without_unit(name) in known:
            message = (
                "a unit is no part of this name; skred import FOLDER --out NEW-FOLDER reads it, or write the"
                f" numbers in the format's unit and call the column {_without_unit(name)}"
            )
        elif name not in known and not extra_allowed:
            message = f"unknown column; expected {', '.join(known)}: rename or remove it"
        else:
            continue
        problems.append(Problem(file, line, name, name, message))
    for column in columns:
        if column.required and column.name not in (*header, *map(_without_unit, header)):
            problems.append(Problem(file, line, column.name, None, "the column is missing; add it"))
    return problems


def _without_unit(name: str) -> str:
    """A column's name without a unit in brackets behind it; empty where it has none."""
    base, bracket, _ = name.replace("(", "[").partition("[")
    return base.strip() if bracket else ""


def _read_rows(
    file: str, lines: Iterator[tuple[int, list[str]]], readers: Mapping[str, ReadCell]
) -> tuple[list[Row], list[Problem], bool]:
    """Read every row; the last value tells whether the table was read to its end."""
    rows: list[Row] = []
    problems: list[Problem] = []
    try:
        for line, texts in lines:
            if len(rows) == MOST_ROWS:
                message = f"more than {MOST_ROWS} rows; split the campaign"
                problems.append(Problem(file, line, None, None, message))
                return rows, problems, False
            if len(problems) > MOST_PROBLEMS:
                return rows, problems, False
            row, of_row = _read_row(file, line, texts, readers)
            rows.append(row)
            problems += of_row
    except _CsvError as error:
        problems.append(error.problem(file))
        return rows, problems, False
    return rows, problems, True


def _by_column(problems: Sequence[Problem], rows: Sequence[Row], header_line: int) -> list[Problem]:
    """Tell a mistake in every cell of a column once, at its header: it is a mistake of the column."""
    told: dict[tuple[str | None, str], list[Problem]] = {}
    for problem in problems:
        told.setdefault((problem.column, problem.message), []).append(problem)
    result: list[Problem] = []
    for (column, message), same in told.items():
        if column is None or len(same) < FEWEST_OF_A_COLUMN or any(row.cells.get(column) for row in rows):
            result += same
            continue
        text = f"in each of {len(same)} rows, first in row {same[0].row}: {message}"
        result.append(Problem(same[0].file, header_line, column, same[0].found, text))
    return result


def _read_row(
    file: str, line: int, texts: list[str], readers: Mapping[str, ReadCell]
) -> tuple[Row, list[Problem]]:
    """Read every cell of a row by its column."""
    problems = []
    pairs = list(zip(readers.items(), texts, strict=False))
    if len(texts) != len(readers):
        message = (
            f"the row has {len(texts)} cells, the header has {len(readers)}; add or remove cells, write "
            "decimal points instead of commas, and quote text that contains a comma"
        )
        problems.append(Problem(file, line, None, ",".join(texts), message))
        # Which cell belongs where is not known; only the first, the id of most tables, is taken.
        pairs = pairs[:1]
    cells: dict[str, Value] = {}
    for (name, read), text in pairs:
        try:
            cells[name] = read(text)
        except CellError as error:
            problems.append(Problem(file, line, name, text, str(error)))
    return Row(line, cells, frozenset(readers) - frozenset(cells)), problems
