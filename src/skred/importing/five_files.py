"""The campaign format's own tables in another dialect: the same columns, numbers and places turned."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from skred.campaign import CampaignError, Problem
from skred.campaign.cells import CellError, has_unit, number
from skred.campaign.problems import shown
from skred.campaign.reading import EVENTS, RECORDINGS, SENSORS
from skred.importing.draft import DraftTable, Where, with_where
from skred.importing.mapping import Cells, Place
from skred.importing.mapping import Mapping as Declared
from skred.importing.numbers import Notation, notation_of
from skred.importing.places import Places
from skred.importing.questions import Question, Unclear
from skred.importing.readings import BOUNDS, bound_question, number_of, silence
from skred.importing.sheet import TABLE, Sheet
from skred.importing.units import base_and_unit, unit_of

TEXT = frozenset(("sensor", "quantity", "event", "status"))
"""Columns of the format that hold words; all others hold numbers."""
COLUMNS = {"sensors": SENSORS, "events": EVENTS, "recordings": RECORDINGS}
READINGS = ("value", "value_to", "sd")
"""Columns of recordings that hold speeds and runouts."""
FACTORS = {"km/h": 1 / 3.6, "km": 1000.0}
"""What turns a unit into the format's."""
_LIKE_NUMBER = re.compile(r"[+-]?[\d.,' ]+")


def read_five_files(
    sheets: Mapping[str, Sheet], declared: Declared, places: Places
) -> tuple[dict[str, DraftTable], dict[str, Notation]]:
    """Read sensors, events and recordings.

    Parameters
    ----------
    sheets : mapping
        By table; ``sensors``, ``events`` and ``recordings``.
    declared : Mapping
    places : Places
        The track, to turn places that are declared as ``x``, ``altitude`` or ``reference``.

    Returns
    -------
    tables : dict of str to DraftTable
    notations : dict of str to Notation

    Raises
    ------
    CampaignError
        With every cell that cannot be read.
    Unclear
        If covariates have numbers and no unit.
    """
    problems, questions = list[Problem](), list[Question]()
    tables, notations = dict[str, DraftTable](), dict[str, Notation]()
    names = {"events": _covariates(sheets["events"], declared, questions)}
    names["recordings"], asked = _with_units(sheets["recordings"], declared)
    questions += asked
    for table, sheet in sheets.items():
        written = _written(sheet, names.get(table, {}), problems)
        numeric = [new for new in written if _is_numeric(table, new)]
        cells = ((line, written[new], text) for new in numeric for line, text in sheet.cells(written[new]))
        try:
            writing = (declared.table.decimal, declared.table.thousands)
            notations[table] = notation_of(cells, sheet.file, sheet.separator, writing, TABLE)
        except Unclear as error:
            questions += error.questions
            continue
        except CampaignError as error:
            problems += error.problems
            continue
        rows = rows_with_points(sheet, written, numeric, notations[table], problems)
        tables[table] = DraftTable(tuple(written), with_where(sheet, rows, written))
    if problems:
        raise CampaignError(problems)
    if questions:
        raise Unclear(questions)
    _turn(tables, declared, places, problems)
    if problems:
        raise CampaignError(problems)
    return tables, notations


def _written(sheet: Sheet, renames: Mapping[str, str], problems: list[Problem]) -> dict[str, str]:
    """The columns that are kept, by their new names; two that would have one are a problem."""
    written = dict[str, str]()
    for name in sheet.columns:
        new = renames.get(name, name)
        if new != "" and written.setdefault(new, name) != name:
            message = (
                f"it would be called '{new}', as is column '{written[new]}'; give it another name with "
                '--column "NAME=covariate name=OTHER"'
            )
            problems.append(Problem(sheet.file, sheet.header_line, name, None, message))
    return written


def rows_with_points(
    sheet: Sheet,
    written: Mapping[str, str],
    numeric: list[str],
    notation: Notation,
    problems: list[Problem],
) -> list[tuple[int, dict[str, str]]]:
    """A table's rows with new names and decimal points.

    Parameters
    ----------
    sheet : Sheet
    written : mapping
        From new names to the sheet's.
    numeric : list of str
        New names of the columns that hold numbers; blanks are left.
    notation : Notation
    problems : list of Problem
        What cannot be read is added.

    Returns
    -------
    list of (int, dict)
        Row number and cells.
    """
    rows = []
    for line, row in sheet.rows():
        cells = {new: row[name] for new, name in written.items()}
        for new in numeric:
            try:
                cells[new] = notation.with_point(cells[new]) if cells[new] else ""
            except CellError as error:
                message = _in_columns(cells[new], notation) if new == "value" else ""
                problem = Problem(sheet.file, line, written[new], cells[new], message or str(error))
                problems.append(problem)
        rows.append((line, cells))
    return rows


def _in_columns(text: str, notation: Notation) -> str:
    """How a cell with more than a number is written in the format's columns; empty where it is not known."""
    if silence(text, Cells()) is not None:
        return (
            "no number; leave it empty, with the status 'missing' (no reading) or 'not_reached' (the"
            " avalanche stopped above)"
        )
    try:
        said = number_of(text, notation)
    except CellError:
        return ""
    cells = {"value": said.value, "value_to": said.value_to, "sd": said.sd}
    listed = [f"{name} {cell.replace('.', notation.decimal)}" for name, cell in cells.items() if cell]
    return f"this takes more than one column here: write {', '.join(listed)}, status {said.status}"


def _is_numeric(table: str, name: str) -> bool:
    """Whether a column of that name holds numbers."""
    known = {column.name for column in COLUMNS[table]}
    return name not in TEXT if name in known else table == "events" and has_unit(name)


def _with_units(sheet: Sheet, declared: Declared) -> tuple[dict[str, str], list[Question]]:
    """New names of columns of readings whose names say a unit of speeds; the column holds runouts too."""
    names, questions = dict[str, str](), list[Question]()
    for name in sheet.columns:
        base, written = base_and_unit(name)
        unit = unit_of("front_velocity", name) if base in READINGS and written else None
        if not unit:
            continue
        names[name] = base
        if unit == "m/s" or declared.velocity.unit is not None or questions:
            continue
        asked = f"are speeds in {unit} (value, value_to and sd alike; runouts stay in their own unit)?"
        where = f"{sheet.file}, column {shown(name)}"
        questions.append(Question(("velocity", "unit"), where, asked, ("km/h", "m/s")))
    return names, questions


def _covariates(sheet: Sheet, declared: Declared, questions: list[Question]) -> dict[str, str]:
    """New names of the events' covariates; empty for one that is left out."""
    names = dict[str, str]()
    known = {column.name for column in EVENTS}
    for name in sheet.columns:
        if name in known:
            continue
        meant = declared.columns.get(name)
        if meant is not None and meant.is_ in ("covariate", "ignore"):
            names[name] = "" if meant.is_ == "ignore" else meant.name or name
        elif not has_unit(name) and any(_LIKE_NUMBER.fullmatch(text) for _, text in sheet.cells(name)):
            text = "a covariate with numbers and without a unit: what is its unit? (_1 for a pure number)"
            where = f"{sheet.file}, column {name}"
            example = f"covariate name={re.sub(r'\W+', '_', name)}_UNIT"
            questions.append(Question(("columns", name), where, text, (), example))
    return names


@dataclass(frozen=True)
class _Turner:
    """Turns cells of one row in place, and keeps what cannot be turned."""

    where: Where
    row: dict[str, str]
    problems: list[Problem]

    def turn(self, key: str, by: Callable[[float], float]) -> bool:
        """Turn one cell; tells whether it holds a turned number now."""
        if not self.row.get(key):
            return False
        try:
            self.row[key] = repr(float(by(number(self.row[key]))))
        except CellError as error:
            column = self.where.columns.get(key, key)
            self.problems.append(Problem(self.where.file, self.where.line, column, self.row[key], str(error)))
            return False
        return True

    def turn_place(self, key: str, sd_key: str, places: Places, place: Place | None) -> None:
        """Turn a place and its standard deviation, which is of the same kind."""
        if place in (None, "s"):
            return
        given = self.row.get(key, "")
        if self.turn(key, lambda value: places.arc_length(value, place)):
            self.turn(sd_key, lambda sd: places.sd_along(number(given), sd, place))


def _turn(
    tables: Mapping[str, DraftTable], declared: Declared, places: Places, problems: list[Problem]
) -> None:
    """Turn places into arc length, kilometres into metres and km/h into m/s, where that is declared."""
    quantity = {row.get("sensor", ""): row.get("quantity", "") for _, row in tables["sensors"].rows}
    for where, row in tables["sensors"].rows:
        turner = _Turner(where, row, problems)
        for end in ("s_from_m", "s_to_m"):
            turner.turn_place(end, "", places, declared.velocity.place)
    for where, row in tables["events"].rows:
        _Turner(where, row, problems).turn_place(
            "release_s_m", "release_sd_m", places, declared.release.place
        )
    for where, row in tables["recordings"].rows:
        turner = _Turner(where, row, problems)
        kind = quantity.get(row.get("sensor", ""))
        factor = FACTORS.get((declared.runout if kind == "runout" else declared.velocity).unit or "")
        for key in ("value", "sd", "value_to") if factor is not None else ():
            turner.turn(key, lambda value, factor=factor: value * factor)  # type: ignore[misc]
        if kind == "runout":
            _turn_runout(turner, declared, places)


def _turn_runout(turner: _Turner, declared: Declared, places: Places) -> None:
    """Turn a runout and its bounds; of two altitudes the higher is the nearer place."""
    place, row = declared.runout.place, turner.row
    if place in (None, "s"):
        return
    status = row.get("status", "")
    if place == "altitude" and status in BOUNDS and row.get("value"):
        if declared.runout.bounds is None:
            where = f"{turner.where.file}, row {turner.where.line}, column status"
            raise Unclear([bound_question(where, status)])
        if declared.runout.bounds == "altitude":
            row["status"] = BOUNDS[status]
    turner.turn("value_to", lambda value: places.arc_length(value, place))
    turner.turn_place("value", "sd", places, place)
    if place == "altitude" and row.get("value") and row.get("value_to"):
        row["value"], row["value_to"] = sorted((row["value"], row["value_to"]), key=float)
