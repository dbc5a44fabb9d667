"""The table that papers print, a row an avalanche and a column a sensor, as the format's tables."""

from collections.abc import Mapping

from skred.campaign import Problem
from skred.campaign.cells import CellError, has_unit, number
from skred.campaign.tables import MOST_ROWS
from skred.importing.column_meaning import Meaning, by_sensor
from skred.importing.draft import DraftTable, Where
from skred.importing.mapping import Column
from skred.importing.mapping import Mapping as Declared
from skred.importing.numbers import Notation, notation_of
from skred.importing.places import Places
from skred.importing.readings import DASHES, OBSERVED, number_of, silence
from skred.importing.sheet import Section, Sheet
from skred.importing.sources import refuse
from skred.importing.wide import Open, Wide
from skred.importing.wide_readings import recordings

SENSORS = ("sensor", "quantity", "s_from_m", "s_to_m", "relative_sd", "absolute_sd", "place_sd_m")
NUMERIC = ("release", "release_sd", "front_velocity", "runout", "sd")


def read_wide_table(
    sheet: Sheet,
    meanings: Mapping[str, Meaning],
    declared: Declared,
    places: Places,
    open_: Open,
    *,
    section: Section,
    releases: bool,
) -> tuple[dict[str, DraftTable], Notation]:
    """Read a wide table.

    Parameters
    ----------
    sheet : Sheet
    meanings : mapping
        Of every column.
    declared : Mapping
    places : Places
    open_ : Open
        Takes every cell that cannot be read, and every word and blank whose meaning is open.
    section : tuple of str
        Of the mapping file, for questions.
    releases : bool
        Whether any table has a column of releases; else all avalanches start where it is declared.

    Returns
    -------
    tables : dict of str to DraftTable
        ``sensors``, ``events`` and ``recordings``.
    notation : Notation

    Raises
    ------
    CampaignError
        If the table is too large, or points and commas are mixed.
    Unclear
        If its decimal sign is open.
    """
    readings = sum(one.column.is_ in ("front_velocity", "runout") for one in meanings.values())
    if readings * len(sheet.lines) > MOST_ROWS:
        raise refuse(sheet.file, f"more than {MOST_ROWS} readings; split the table")
    numeric = [name for name, one in meanings.items() if _holds_numbers(one.column)]
    cells = ((line, name, text) for name in numeric for line, text in sheet.cells(name))
    writing = declared.writing(sheet.key)
    notation = notation_of(cells, sheet.file, sheet.separator, (writing.decimal, writing.thousands), section)
    wide = Wide(sheet, meanings, declared, places, notation, open_)
    tables = {"sensors": _sensors(wide), "events": _events(wide, releases), "recordings": recordings(wide)}
    return tables, notation


def _holds_numbers(column: Column) -> bool:
    """Whether a column's cells are to be numbers."""
    return column.is_ in NUMERIC or (column.is_ == "covariate" and has_unit(column.name or ""))


def _sensors(wide: Wide) -> DraftTable:
    """One row for each sensor; columns of one sensor describe it alike."""
    rows = []
    for sensor, columns in by_sensor(wide.meanings).items():
        (name, column), *others = columns.items()
        row = _sensor(wide, sensor, name, column)
        for other, one in others:
            differing = [key for key, value in _sensor(wide, sensor, other, one).items() if value != row[key]]
            if differing:
                message = (
                    f"sensor '{sensor}' has another {', '.join(differing)} in column '{name}'; correct one"
                )
                wide.open.problems.append(
                    Problem(wide.sheet.file, wide.sheet.header_line, other, None, message)
                )
        where = Where(wide.sheet.file, wide.sheet.header_line, dict.fromkeys(SENSORS, name))
        rows.append((where, row))
    used = SENSORS if any(row["place_sd_m"] for _, row in rows) else SENSORS[:-1]
    return DraftTable(used, tuple(rows))


def _sensor(wide: Wide, sensor: str, name: str, column: Column) -> dict[str, str]:
    """A row of sensors.csv from the column of its readings."""
    row = {"sensor": sensor, "quantity": column.is_}
    row |= {"relative_sd": repr(column.relative_sd), "absolute_sd": repr(column.absolute_sd)}
    row["place_sd_m"] = "" if column.place_sd_m is None else repr(column.place_sd_m)
    if column.is_ == "front_velocity":
        ends = (column.at, column.at) if column.at is not None else (column.from_, column.to)
        for key, end in zip(("s_from_m", "s_to_m"), ends, strict=True):
            row[key] = ""
            try:
                row[key] = repr(float(wide.places.arc_length(float(end or 0.0), column.place or "s")))
            except CellError as error:
                wide.fail(wide.sheet.header_line, name, repr(end), error)
    return row


def _events(wide: Wide, releases: bool) -> DraftTable:
    """One row for each avalanche; without a release where only another table has releases."""
    [event] = wide.of_kind("event")
    release = wide.of_kind("release")
    release_sd = next(iter(wide.of_kind("release_sd")), None)
    covariates = {name: column.name or name for name, column in wide.of_kind("covariate").items()}
    names = {"event": event, "release_s_m": next(iter(release), event)}
    if release_sd is not None:
        names["release_sd_m"] = release_sd
    columns = (*names, *covariates.values())
    sources = names | {new: name for name, new in covariates.items()}
    same = "" if releases else repr(wide.declared.release.s_m)
    rows = []
    for line, cells in wide.sheet.rows():
        row = {"event": cells[event], "release_s_m": same}
        for name, column in release.items():
            row |= _release(wide, line, cells, name, column, release_sd)
        for name, new in covariates.items():
            row[new] = _covariate(wide, line, name, cells[name], has_unit(new))
        rows.append((Where(wide.sheet.file, line, sources, cells), row))
    return DraftTable(columns, tuple(rows))


def _release(
    wide: Wide, line: int, cells: Mapping[str, str], name: str, column: Column, sd_name: str | None
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


def _covariate(wide: Wide, line: int, name: str, text: str, is_number: bool) -> str:
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
