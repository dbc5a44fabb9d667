"""Excel workbooks: values as they are stored; nothing is computed, everything is bounded."""

import io
import math
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from datetime import date, datetime, time
from typing import IO, Any
from xml.parsers import expat

from skred.campaign.problems import CampaignError, Problem
from skred.campaign.tables import MOST_COLUMNS, MOST_LINES, MOST_PROBLEMS
from skred.importing.questions import Question, Unclear
from skred.importing.sheet import TABLE, TRACK, Grid, NumberText, Section, in_one_line
from skred.importing.sources import Source, refuse

LARGEST_UNPACKED_BYTES = 100_000_000
"""Five times the largest file: tables of text shrink so much when packed, bombs far more."""
MOST_PARTS = 1000
MOST_CELLS = 5_000_000
CHUNK_BYTES = 65_536


class EmptySheet(CampaignError):
    """A sheet without cells."""


def sheet_names(source: Source) -> tuple[str, ...]:
    """Names of a workbook's sheets.

    Raises
    ------
    CampaignError
        If it is no workbook that can be read safely.
    """
    book = _opened(source, values=True)
    try:
        return tuple(sheet.title for sheet in book.worksheets)
    finally:
        book.close()


def read_workbook(source: Source, name: str | None, section: Section) -> Grid:
    """Read one sheet.

    Parameters
    ----------
    source : Source
    name : str or None
        The sheet; by default the only one.
    section : tuple of str
        Of the mapping file, for questions.

    Raises
    ------
    CampaignError
        If the workbook cannot be read safely, the sheet is not there, or a formula has no stored value.
    EmptySheet
        If the sheet has no cells.
    Unclear
        If there are several sheets and none is named.
    """
    names = sheet_names(source)
    if name is None and len(names) != 1:
        raise Unclear([which_sheet(source, names, section)])
    if name is not None and name not in names:
        raise refuse(source.name, f"no sheet named '{name}'; there are: {', '.join(names)}")
    chosen = name or names[0]
    values = list(_cells(source, chosen, values=True))
    lines = [(line, tuple(_text(cell) for cell in row)) for line, row in values]
    problems = _without_value(source, chosen, lines)
    if problems:
        raise CampaignError(problems)
    file, key = source.name, source.key
    if len(names) > 1:
        file, key = f"{source.name} ({chosen})", chosen
    filled = tuple((line, cells) for line, cells in lines if any(cells))
    if not filled:
        raise EmptySheet([Problem(file, None, None, None, "the sheet is empty; write its header and rows")])
    return Grid(file, filled, "Excel", None, key)


def which_sheet(source: Source, names: tuple[str, ...], section: Section) -> Question:
    """The question which of a workbook's sheets is meant."""
    text = f"the workbook has the sheets {', '.join(names)}; which of them?"
    if section == TRACK:
        return Question((*section, "sheet"), source.name, text, names, f'"{names[0]}"')
    text += " (* for all; --sheet may be repeated)"
    return Question((*TABLE, "sheet"), source.name, text, (*names, "*"), f'"{names[0]}"', "--sheet")


def _opened(source: Source, *, values: bool) -> Any:
    """The workbook: its stored values, or its formulas as text."""
    import openpyxl

    _refuse_bomb(source)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that are not read
            return openpyxl.load_workbook(
                io.BytesIO(source.content), read_only=True, data_only=values, keep_links=False
            )
    except Exception as error:  # whatever a stranger's file makes the library raise
        raise _unreadable(source, error) from error


def _unreadable(source: Source, error: Exception) -> CampaignError:
    what = f"{type(error).__name__}: {error}"[:100]
    return refuse(source.name, f"not a workbook that can be read ({what}); save it as .xlsx or CSV")


def _refuse_bomb(source: Source) -> None:
    """Refuse what would unpack to more than a table of this program can be, and declarations of entities."""
    try:
        with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
            parts = archive.infolist()
            if len(parts) > MOST_PARTS or sum(part.file_size for part in parts) > LARGEST_UNPACKED_BYTES:
                raise refuse(source.name, "the workbook unpacks to more than is read; save one sheet as CSV")
            for part in parts:
                with archive.open(part) as opened:
                    if _declares_a_type(opened):
                        message = "the workbook declares a document type; save it anew as .xlsx"
                        raise refuse(source.name, message)
    except CampaignError:
        raise
    except Exception as error:  # damaged, encrypted, or packed in a way that zipfile does not know
        raise _unreadable(source, error) from error


def _declares_a_type(part: IO[bytes]) -> bool:
    """Whether a part is XML with a document type, in whatever encoding and behind whatever comments.

    Read with the parser that reads the tables, as far as the first element: a type can stand only before it.
    A part that is no XML has none.
    """
    found = list[bool]()
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = lambda *_: found.append(True)
    parser.StartElementHandler = lambda *_: found.append(False)
    with suppress(expat.ExpatError):
        while not found and (chunk := part.read(CHUNK_BYTES)):
            parser.Parse(chunk, False)
    return found[:1] == [True]


def _cells(source: Source, name: str, *, values: bool) -> Iterator[tuple[int, tuple[object, ...]]]:
    """Rows of a sheet from the first, bounded."""
    book = _opened(source, values=values)
    count = 0
    try:
        sheet = book[name]
        sheet.reset_dimensions()  # what a file says of its size may be wrong
        for line, row in enumerate(sheet.iter_rows(values_only=True), start=1):
            while row and row[-1] is None:
                row = row[:-1]
            count += len(row)
            if line > MOST_LINES or count > MOST_CELLS or len(row) > 10 * MOST_COLUMNS:
                raise refuse(
                    source.name,
                    "the sheet has more rows, columns or cells than are read; delete empty rows "
                    "at its end, or split it",
                )
            yield line, row
    except CampaignError:
        raise
    except Exception as error:
        raise _unreadable(source, error) from error
    finally:
        book.close()


def _without_value(source: Source, name: str, lines: list[tuple[int, tuple[str, ...]]]) -> list[Problem]:
    """Formulas whose result is not stored: they would look like blanks.

    They are what stands in a cell that has no value. Of what kind they are (text, one of several cells, a
    table of data) does not matter.
    """
    known = dict(lines)
    problems = []
    for line, row in _cells(source, name, values=False):
        values = known.get(line, ())
        for k, cell in enumerate(row):
            if values[k : k + 1] > ("",) or not _text(cell):
                continue
            text = cell if isinstance(cell, str) else getattr(cell, "text", None)
            message = "a formula without a stored result; open and save the workbook, or paste values"
            problems.append(Problem(source.name, line, f"number {k + 1}", text, message))
            if len(problems) == MOST_PROBLEMS:
                return problems
    return problems


def _text(cell: object) -> str:
    """A cell's value as text: numbers with a decimal point, dates as year-month-day."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, int | float):
        if isinstance(cell, float) and math.isfinite(cell) and cell == int(cell) and abs(cell) < 1e15:
            cell = int(cell)
        return NumberText(repr(cell))
    if isinstance(cell, datetime):
        return cell.date().isoformat() if cell.time() == time() else cell.isoformat(sep=" ")
    if isinstance(cell, date | time):
        return cell.isoformat()
    return in_one_line(str(cell))
