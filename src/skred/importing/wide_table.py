"""The table that papers print, a row an avalanche and a column a sensor, as the format's tables."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from skred.campaign import CampaignError, Problem
from skred.campaign.cells import CellError, has_unit, number
from skred.campaign.problems import shown
from skred.campaign.tables import MOST_ROWS
from skred.importing.draft import DraftTable, Where
from skred.importing.five_files import FACTORS
from skred.importing.mapping import Column
from skred.importing.mapping import Mapping as Declared
from skred.importing.numbers import Notation, notation_of
from skred.importing.places import Places
from skred.importing.questions import Question, Unclear
from skred.importing.readings import DASHES, MISSING, OBSERVED, number_of, silence
from skred.importing.sheet import Sheet
from skred.importing.sources import refuse
from skred.importing.wide_columns import Meaning, sensor_id

SENSORS = ("sensor", "quantity", "s_from_m", "s_to_m", "relative_sd", "absolute_sd", "place_sd_m")
RECORDINGS = ("event", "sensor", "value", "sd", "status")
NUMERIC = ("release", "release_sd", "front_velocity", "runout", "sd")


@dataclass
class _Open:
    """What is wrong and what is open, kept until the whole table was read."""

    problems: list[Problem] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)

    def settle(self) -> None:
        """Raise what there is."""
        if self.problems:
            raise CampaignError(self.problems)
        if self.questions:
            raise Unclear(self.questions)


@dataclass(frozen=True)
class _Wide:
    """A wide table with everything that is needed to read its cells."""

    sheet: Sheet
    meanings: Mapping[str, Meaning]
    declared: Declared
    places: Places
    notation: Notation
    open: _Open

    def of_kind(self, *kinds: str) -> dict[str, Column]:
        """Columns of some kinds."""
        return {name: one.column for name, one in self.meanings.items() if one.column.is_ in kinds}

    def fail(self, line: int, name: str, found: str, error: CellError) -> None:
        """Keep a problem of a cell."""
        self.open.problems.append(Problem(self.sheet.file, line, name, found, str(error)))


def read_wide_table(
    sheet: Sheet, meanings: Mapping[str, Meaning], declared: Declared, places: Places
) -> tuple[dict[str, DraftTable], Notation]:
    """Read a wide table.

    Parameters
    ----------
    sheet : Sheet
    meanings : mapping
        Of every column.
    declared : Mapping
    places : Places

    Returns
    -------
    tables : dict of str to DraftTable
        ``sensors``, ``events`` and ``recordings``.
    notation : Notation

    Raises
    ------
    CampaignError
        With every cell that cannot be read.
    Unclear
        With every word and blank whose meaning is open.
    """
    readings = sum(one.column.is_ in ("front_velocity", "runout") for one in meanings.values())
    if readings * len(sheet.lines) > MOST_ROWS:
        raise refuse(sheet.file, f"more than {MOST_ROWS} readings; split the table")
    numeric = [name for name, one in meanings.items() if _holds_numbers(one.column)]
    cells = ((line, name, text) for name in numeric for line, text in sheet.cells(name))
    writing = (declared.table.decimal, declared.table.thousands)
    notation = notation_of(cells, sheet.file, sheet.separator, writing, "table")
    wide = _Wide(sheet, meanings, declared, places, notation, _Open())
    tables = {"sensors": _sensors(wide), "events": _events(wide), "recordings": _recordings(wide)}
    wide.open.settle()
    return tables, notation


def _holds_numbers(column: Column) -> bool:
    """Whether a column's cells are to be numbers."""
    return column.is_ in NUMERIC or (column.is_ == "covariate" and has_unit(column.name or ""))


def _sensors(wide: _Wide) -> DraftTable:
    """One row for each column of readings."""
    rows = []
    for name, column in wide.of_kind("front_velocity", "runout").items():
        row = {"sensor": sensor_id(name, column), "quantity": column.is_}
        row |= {"relative_sd": repr(column.relative_sd), "absolute_sd": repr(column.absolute_sd)}
        row["place_sd_m"] = "" if column.place_sd_m is None else repr(column.place_sd_m)
        if column.is_ == "front_velocity":
            ends = (column.at, column.at) if column.at is not None else (column.from_, column.to)
            for key, end in zip(("s_from_m", "s_to_m"), ends, strict=True):
                try:
                    row[key] = repr(float(wide.places.arc_length(float(end or 0.0), column.place or "s")))
                except CellError as error:
                    wide.fail(wide.sheet.header_line, name, repr(end), error)
        where = Where(wide.sheet.file, wide.sheet.header_line, dict.fromkeys(SENSORS, name))
        rows.append((where, row))
    used = SENSORS if any(row["place_sd_m"] for _, row in rows) else SENSORS[:-1]
    return DraftTable(used, tuple(rows))


def _events(wide: _Wide) -> DraftTable:
    """One row for each avalanche."""
    [event] = wide.of_kind("event")
    release = wide.of_kind("release")
    release_sd = next(iter(wide.of_kind("release_sd")), None)
    covariates = {name: column.name or name for name, column in wide.of_kind("covariate").items()}
    names = {"event": event, "release_s_m": next(iter(release), event)}
    if release_sd is not None:
        names["release_sd_m"] = release_sd
    columns = (*names, *covariates.values())
    sources = names | {new: name for name, new in covariates.items()}
    rows = []
    for line, cells in wide.sheet.rows():
        row = {"event": cells[event], "release_s_m": repr(wide.declared.release.s_m)}
        for name, column in release.items():
            row |= _release(wide, line, cells, name, column, release_sd)
        for name, new in covariates.items():
            row[new] = _covariate(wide, line, name, cells[name], has_unit(new))
        rows.append((Where(wide.sheet.file, line, sources, cells), row))
    return DraftTable(columns, tuple(rows))


def _release(
    wide: _Wide, line: int, cells: Mapping[str, str], name: str, column: Column, sd_name: str | None
) -> dict[str, str]:
    """Where one avalanche starts, and how well that is known."""
    try:
        read = number_of(cells[name], wide.notation)
        if read.status != OBSERVED:
            raise CellError("a release is one place; write the number alone")
        given = read.sd
        if sd_name is not None and cells[sd_name] and cells[sd_name] not in DASHES:
            given = wide.notation.with_point(cells[sd_name])
        place = column.place or "s"
        if place == "s":
            return {"release_s_m": read.value, "release_sd_m": given}
        value = number(read.value)
        sd = repr(wide.places.sd_along(value, number(given), place)) if given else ""
        return {"release_s_m": repr(wide.places.arc_length(value, place)), "release_sd_m": sd}
    except CellError as error:
        wide.fail(line, name, cells[name], error)
        return {}


def _covariate(wide: _Wide, line: int, name: str, text: str, is_number: bool) -> str:
    """A property of one avalanche; blanks, dashes and declared words mean that it is not known."""
    silent = silence(text, wide.declared.cells)
    if text == "" or text in DASHES:
        return ""
    if not is_number:
        return text
    if silent is not None and silent[1] is not None:
        return ""
    try:
        return wide.notation.with_point(text)
    except CellError as error:
        wide.fail(line, name, text, error)
        return ""


def _recordings(wide: _Wide) -> DraftTable:
    """One row for each avalanche and sensor."""
    [event] = wide.of_kind("event")
    sds = {column.of: name for name, column in wide.of_kind("sd").items()}
    columns = wide.of_kind("front_velocity", "runout")
    rows = []
    for line, cells in wide.sheet.rows():
        for name, column in columns.items():
            sensor = sensor_id(name, column)
            sd_name = sds.get(sensor)
            sd_text = "" if sd_name is None else cells[sd_name]
            sources = {"event": event, "sensor": name, "value": name, "sd": sd_name or name, "status": name}
            row = {"event": cells[event], "sensor": sensor}
            row |= _reading(wide, line, (name, cells[name]), column, (sd_name or name, sd_text))
            rows.append((Where(wide.sheet.file, line, sources, cells), row))
    used = tuple(key for key in RECORDINGS if key != "sd" or any(row.get("sd") for _, row in rows))
    return DraftTable(used, tuple(rows))


def _reading(
    wide: _Wide, line: int, cell: tuple[str, str], column: Column, sd_cell: tuple[str, str]
) -> dict[str, str]:
    """Value, standard deviation and status of one reading."""
    (name, text), (sd_name, sd_text) = cell, sd_cell
    silent = silence(text, wide.declared.cells)
    if silent is not None:
        return {"status": _silence(wide, line, name, text, column, silent)}
    try:
        read = number_of(text, wide.notation)
        if read.status != OBSERVED and column.is_ != "runout":
            raise CellError("only a runout is known as a bound; write the velocity, or leave it out")
    except CellError as error:
        wide.fail(line, name, text, error)
        return {}
    sd = read.sd
    try:
        if sd_text and sd_text not in DASHES:
            sd = wide.notation.with_point(sd_text)
        return _turned(wide, column, read.value, sd) | {"status": read.status}
    except CellError as error:
        wide.fail(line, sd_name if sd_text else name, sd_text or text, error)
        return {}


def _silence(
    wide: _Wide,
    line: int,
    name: str,
    text: str,
    column: Column,
    silent: tuple[tuple[str, ...], str | None],
) -> str:
    """Status of a cell without a number; a question where nobody said."""
    key, status = silent
    if column.is_ == "runout" and (text == "" or text in DASHES or status is not None):
        return MISSING  # every avalanche has a runout: it can only be unknown
    if status is None:
        option = {"blank": "--blank", "dash": "--dash"}.get(key[-1], "")
        what = f"'{shown(text, 40)}'" if text else "a blank cell"
        question = f"{what}: no reading (missing), or did the avalanche stop above (not_reached)?"
        where = f"{wide.sheet.file}, row {line}, column {shown(name)}"
        wide.open.questions.append(Question(key, where, question, (MISSING, "not_reached"), "", option))
    return status or MISSING


def _turned(wide: _Wide, column: Column, value: str, sd: str) -> dict[str, str]:
    """A reading in the format's unit, and a runout as arc length."""
    factor = FACTORS.get(column.unit or "")
    if factor is not None:
        value = repr(number(value) * factor)
        sd = repr(number(sd) * factor) if sd else ""
    if column.is_ == "runout" and column.place not in (None, "s"):
        place = str(column.place)
        given = number(value)
        sd = repr(float(wide.places.sd_along(given, number(sd), place))) if sd else ""
        value = repr(float(wide.places.arc_length(given, place)))
    return {"value": value, "sd": sd}
