"""The sensors that go with a wide table: a table as the format's sensors.csv, in any dialect."""

from collections.abc import Mapping
from dataclasses import replace

from skred.campaign import CampaignError, Problem
from skred.campaign.cells import CellError
from skred.campaign.rules import sensor_problems
from skred.campaign.tables import MOST_PROBLEMS, Row, Value
from skred.importing.draft import DraftTable, with_where
from skred.importing.five_files import COLUMNS, TEXT, rows_with_points
from skred.importing.mapping import Mapping as Declared
from skred.importing.numbers import Notation, notation_of
from skred.importing.questions import Unclear
from skred.importing.sheet import TABLE, Sheet

SENSORS = COLUMNS["sensors"]
ASKED = frozenset(("relative_sd", "absolute_sd"))
"""Columns whose blanks are asked about once the table's own columns are known."""


def read_sensors(sheet: Sheet, declared: Declared, length_m: float | None) -> DraftTable:
    """Read the sensors of a wide table.

    Parameters
    ----------
    sheet : Sheet
    declared : Mapping
    length_m : float or None
        Length of the track, if it could be read.

    Raises
    ------
    CampaignError
        With everything that the format's reader would refuse, by row and column.
    Unclear
        If the decimal sign is open.
    """
    problems = _header_problems(sheet)
    if problems:
        raise CampaignError(problems)
    numeric = [name for name in sheet.columns if name not in TEXT]
    notation = _notation(sheet, numeric, declared)
    names = {name: name for name in sheet.columns}
    rows = rows_with_points(sheet, names, numeric, notation, problems)
    if not problems:
        read = [Row(line, *_values(sheet, line, cells, problems)) for line, cells in rows]
        problems += sensor_problems(read, length_m)
    if problems:
        in_order = sorted(problems, key=lambda problem: problem.row or 0)
        raise CampaignError(_as_written(sheet, in_order[:MOST_PROBLEMS]))
    return DraftTable(sheet.columns, with_where(sheet, rows, names))


def _as_written(sheet: Sheet, problems: list[Problem]) -> list[Problem]:
    """Problems with the file's name and what stands in its cells."""
    texts = dict(sheet.rows())
    return [
        replace(one, file=sheet.file, found=texts.get(one.row or 0, {}).get(one.column or "", one.found))
        for one in problems
    ]


def _header_problems(sheet: Sheet) -> list[Problem]:
    """Columns that the format does not know, which would be lost silently, and those that are missing."""
    known = [column.name for column in SENSORS]
    message = f"unknown column; expected {', '.join(known)}: rename or remove it"
    problems = [
        Problem(sheet.file, sheet.header_line, name, None, message)
        for name in sheet.columns
        if name not in known
    ]
    missing = [column.name for column in SENSORS if column.required and column.name not in sheet.columns]
    if missing:
        message = f"the columns {', '.join(missing)} are missing; add them"
        problems.append(Problem(sheet.file, sheet.header_line, None, None, message))
    return problems


def _notation(sheet: Sheet, numeric: list[str], declared: Declared) -> Notation:
    """How the table writes numbers; where it does not tell, as was declared of tables."""
    cells = [(line, name, text) for name in numeric for line, text in sheet.cells(name)]
    try:
        return notation_of(cells, sheet.file, sheet.separator, (None, None), TABLE)
    except Unclear:
        writing = (declared.table.decimal, declared.table.thousands)
        return notation_of(cells, sheet.file, sheet.separator, writing, TABLE)


def _values(
    sheet: Sheet, line: int, cells: Mapping[str, str], problems: list[Problem]
) -> tuple[dict[str, Value], frozenset[str]]:
    """A row's cells as the format's reader reads them, and those that it refuses."""
    values = dict[str, Value]()
    for column in SENSORS:
        text = cells.get(column.name)
        if text is None or (text == "" and column.name in ASKED):
            continue
        try:
            values[column.name] = column.read(text)
        except CellError as error:
            problems.append(Problem(sheet.file, line, column.name, text, str(error)))
    return values, frozenset(cells) - frozenset(values)
