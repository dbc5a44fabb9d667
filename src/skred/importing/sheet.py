"""A table of text: rows of cells under a header, whatever file they came from."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from skred.campaign.cells import LONGEST_WORD
from skred.campaign.problems import CampaignError, Problem
from skred.campaign.tables import MOST_COLUMNS, MOST_ROWS
from skred.importing.questions import Question, Unclear
from skred.importing.sources import refuse

Section = tuple[str, ...]
"""Where a mapping file says how a table is written: ``("table",)``, ``("tables", NAME)``, ``("track",)``."""
TABLE: Section = ("table",)
TRACK: Section = ("track",)
_UNITS = re.compile(r"[\[(].*[\])]|m|km|m/s|km/h|m\^?[23]|m[²³]|°\s?C|degC|%|kg/m3|kg/m³|masl|m a\.?s\.?l\.?")


def in_one_line(text: str) -> str:
    """A cell's text without blanks around it and without line breaks in it."""
    return " ".join(part.strip() for part in text.strip().splitlines() if part.strip())


class NumberText(str):
    """A number that a workbook holds as a number: its text always has a decimal point."""

    __slots__ = ()


@dataclass(frozen=True)
class Grid:
    """Rows of cells before the header is known.

    Attributes
    ----------
    file : str
        For messages; with the sheet's name where a workbook has several.
    lines : tuple of (int, tuple of str)
        Each row's number in the file, from 1, and its cells without surrounding blanks. No empty rows.
    written : str
        Encoding and separator in words.
    separator : str or None
        None for a workbook.
    key : str
        The table's name in a mapping file.
    """

    file: str
    lines: tuple[tuple[int, tuple[str, ...]], ...]
    written: str
    separator: str | None
    key: str = ""


@dataclass(frozen=True)
class Sheet:
    """A table under its header; every row has a cell for every column."""

    file: str
    header_line: int
    columns: tuple[str, ...]
    lines: tuple[tuple[int, tuple[str, ...]], ...]
    written: str
    separator: str | None
    key: str = ""

    def cells(self, column: str) -> Iterator[tuple[int, str]]:
        """Row numbers and cells of a column."""
        position = self.columns.index(column)
        return ((line, cells[position]) for line, cells in self.lines)

    def rows(self) -> Iterator[tuple[int, dict[str, str]]]:
        """Row numbers and cells by column."""
        return ((line, dict(zip(self.columns, cells, strict=True))) for line, cells in self.lines)


def sheet_of(grid: Grid, header_row: int | None, section: Section) -> Sheet:
    """Find the header and put every cell under it.

    Parameters
    ----------
    grid : Grid
    header_row : int or None
        Row that holds the columns' names; by default the first that is not empty.
    section : tuple of str
        Of the mapping file, for questions.

    Raises
    ------
    CampaignError
        If columns have no name (merged header cells) or the same one, or rows are longer than the header.
    Unclear
        If the first row looks like a title.
    """
    if len(grid.lines) > MOST_ROWS:
        raise refuse(grid.file, f"more than {MOST_ROWS} rows; split the table")
    start = _start(grid, header_row, section)
    line, header = grid.lines[start]
    below = grid.lines[start + 1 :]
    header = tuple(" ".join(name.split()) for name in header)
    _refuse_short_or_long(grid, header, below)
    kept = [k for k, name in enumerate(header) if name or any(cells[k : k + 1] > ("",) for _, cells in below)]
    problems = _name_problems(grid.file, line, header, kept, below)
    if below and all(_UNITS.fullmatch(cell) for cell in below[0][1] if cell):
        message = (
            "the row holds units only; write each into the name above it, such as 'v [m/s]', and remove it"
        )
        problems.append(Problem(grid.file, below[0][0], None, None, message))
    if problems:
        raise CampaignError(problems)
    padded = ((number, cells + ("",) * (len(header) - len(cells))) for number, cells in below)
    lines = tuple((number, tuple(cells[k] for k in kept)) for number, cells in padded)
    if not lines:
        raise refuse(grid.file, "no rows under the header; write at least one", line)
    names = tuple(header[k] for k in kept)
    return Sheet(grid.file, line, names, lines, grid.written, grid.separator, grid.key)


def _start(grid: Grid, header_row: int | None, section: Section) -> int:
    """Number of the header among the rows."""
    if header_row is not None:
        for k, (line, _) in enumerate(grid.lines):
            if line == header_row:
                return k
        raise refuse(
            grid.file, f"row {header_row} is empty or not there; correct {'.'.join(section)}.header_row"
        )
    filled = [sum(bool(cell) for cell in cells) for _, cells in grid.lines[:10]]
    if len(filled) > 1 and filled[0] == 1 and max(filled) > 1:
        likely = grid.lines[next(k for k, n in enumerate(filled) if n > 1)][0]
        title = grid.lines[0][1]
        text = (
            f"the first row looks like a title ('{next(filter(None, title))[:40]}'): which row has the names?"
        )
        raise Unclear([Question((*section, "header_row"), grid.file, text, (), str(likely))])
    return 0


def _refuse_short_or_long(
    grid: Grid, header: tuple[str, ...], below: tuple[tuple[int, tuple[str, ...]], ...]
) -> None:
    """Refuse rows that do not fit under the header."""
    if len(header) > MOST_COLUMNS:
        raise refuse(grid.file, f"found {len(header)} columns, at most {MOST_COLUMNS} are read; remove some")
    problems = []
    for line, cells in below:
        too_long = any(cells[len(header) :])
        if too_long or (len(cells) < len(header) and grid.separator is not None):
            message = (
                f"the row has {len(cells)} cells, the header has {len(header)}; quote text that contains "
                "the separator, or declare the right one with --separator, and the header's row"
            )
            problems.append(Problem(grid.file, line, None, None, message))
    if problems:
        raise CampaignError(problems)


def _name_problems(
    file: str,
    line: int,
    header: tuple[str, ...],
    kept: list[int],
    below: tuple[tuple[int, tuple[str, ...]], ...],
) -> list[Problem]:
    """Refuse columns without a name and names that stand twice."""
    problems = []
    for k in kept:
        name = header[k]
        if not name:
            row = next(number for number, cells in below if cells[k : k + 1] > ("",))
            message = (
                f"column {k + 1} has cells (row {row}) and no name; were header cells merged, or the header "
                "written over two rows? Unmerge them and give each column its own name in one row"
            )
        elif name in header[:k]:
            message = f"the name also stands in column {header.index(name) + 1}; give each column its own"
        elif len(name) > LONGEST_WORD:
            message = f"the name has more than {LONGEST_WORD} characters; shorten it"
        else:
            continue
        problems.append(Problem(file, line, name or f"number {k + 1}", None, message))
    return problems
