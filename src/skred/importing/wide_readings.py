"""The readings of a wide table: one for each avalanche and sensor, from one cell or from several."""

from collections.abc import Mapping
from dataclasses import replace

from skred.campaign.cells import CellError, number
from skred.campaign.problems import shown
from skred.importing.column_meaning import by_sensor
from skred.importing.draft import DraftTable, Where
from skred.importing.five_files import FACTORS
from skred.importing.mapping import Column
from skred.importing.questions import Question
from skred.importing.readings import (
    AT_LEAST,
    AT_MOST,
    BETWEEN,
    BOUNDS,
    DASHES,
    MISSING,
    OBSERVED,
    Reading,
    bound_question,
    number_of,
    silence,
)
from skred.importing.wide import Wide

RECORDINGS = ("event", "sensor", "value", "value_to", "sd", "status")


def recordings(wide: Wide) -> DraftTable:
    """One row for each avalanche and sensor."""
    [event] = wide.of_kind("event")
    sds = {column.of: name for name, column in wide.of_kind("sd").items()}
    rows = []
    for line, cells in wide.sheet.rows():
        for sensor, columns in by_sensor(wide.meanings).items():
            said = _said(wide, line, cells, columns, sds.get(sensor))
            if said is None:
                continue
            first, last, reading = said
            sources = {"event": event, "sensor": first, "value": first, "value_to": last, "status": first}
            sources["sd"] = sds.get(sensor) or first
            row = {"event": cells[event], "sensor": sensor, "status": reading.status}
            row |= {"value": reading.value, "value_to": reading.value_to, "sd": reading.sd}
            rows.append((Where(wide.sheet.file, line, sources, cells), row))
    optional = ("value_to", "sd")
    used = [key for key in RECORDINGS if key not in optional or any(row.get(key) for _, row in rows)]
    return DraftTable(tuple(used), tuple(rows))


def _said(
    wide: Wide, line: int, cells: Mapping[str, str], columns: Mapping[str, Column], sd_name: str | None
) -> tuple[str, str, Reading] | None:
    """What a row says of one sensor, with the columns of value and value_to; None where it cannot be read."""
    speaking = {name: column for name, column in columns.items() if not _is_silent(wide, cells[name])}
    if not speaking:
        name = next((name for name in columns if cells[name]), next(iter(columns)))
        return name, name, Reading(_silence(wide, line, name, cells[name], columns[name]))
    found = dict[str, Reading]()
    for name, column in speaking.items():
        reading = _cell(wide, line, cells, name, column, sd_name)
        if reading is None:
            return None
        found[name] = reading
    return _together(wide, line, cells, found)


def _is_silent(wide: Wide, text: str) -> bool:
    return silence(text, wide.declared.cells) is not None


def _cell(
    wide: Wide, line: int, cells: Mapping[str, str], name: str, column: Column, sd_name: str | None
) -> Reading | None:
    """The reading of one cell in the format's units; None where it cannot be read."""
    place, found = name, cells[name]
    try:
        reading = number_of(found, wide.notation)
        if reading.status == OBSERVED and column.bound is not None:
            reading = replace(reading, status=column.bound)
        elif column.bound not in (None, reading.status):
            raise CellError(f"the column holds bounds ({column.bound}); write the number alone")
        reading = _in_format_units(column, reading)
        if sd_name is not None and cells[sd_name] and cells[sd_name] not in DASHES:
            place, found = sd_name, cells[sd_name]
            sd = wide.notation.with_point(found)
            reading = replace(reading, sd=_converted(sd, wide.meanings[sd_name].column.unit))
        if column.is_ == "runout" and column.place == "altitude" and reading.status in BOUNDS:
            reading = _of_altitude(wide, line, name, cells[name], reading)
        return _along_the_track(wide, column, reading)
    except CellError as error:
        wide.fail(line, place, found, error)
        return None


def _together(
    wide: Wide, line: int, cells: Mapping[str, str], found: Mapping[str, Reading]
) -> tuple[str, str, Reading] | None:
    """One reading from the cells of one sensor: two bounds are an interval."""
    (name, first), *others = found.items()
    if not others:
        return name, name, first
    by_status = {reading.status: column for column, reading in found.items()}
    if len(found) == 2 and set(by_status) == {AT_LEAST, AT_MOST}:
        low, high = by_status[AT_LEAST], by_status[AT_MOST]
        sd = found[low].sd or found[high].sd
        return low, high, Reading(BETWEEN, found[low].value, sd, found[high].value)
    names = ", ".join(f"'{one}'" for one in found)
    message = f"the columns {names} say this reading more than once; leave one of the cells empty"
    wide.fail(line, others[0][0], cells[others[0][0]], CellError(message))
    return None


def _of_altitude(wide: Wide, line: int, name: str, text: str, reading: Reading) -> Reading:
    """A bound of a runout that is given as altitude: what is higher is less far."""
    bounds = wide.declared.runout.bounds
    if bounds is None:
        where = f"{wide.sheet.file}, row {line}, column {shown(name)}"
        wide.open.questions.append(bound_question(where, text))
    return replace(reading, status=BOUNDS[reading.status]) if bounds == "altitude" else reading


def _silence(wide: Wide, line: int, name: str, text: str, column: Column) -> str:
    """Status of a cell without a number; a question where nobody said."""
    silent = silence(text, wide.declared.cells)
    assert silent is not None
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


def _converted(text: str, unit: str | None) -> str:
    """A number in the format's unit; blanks are left."""
    factor = FACTORS.get(unit or "")
    return text if factor is None or not text else repr(number(text) * factor)


def _in_format_units(column: Column, reading: Reading) -> Reading:
    """What a cell says, m/s or m; of places still as they are given."""
    value, sd, value_to = (
        _converted(text, column.unit) for text in (reading.value, reading.sd, reading.value_to)
    )
    return replace(reading, value=value, sd=sd, value_to=value_to)


def _along_the_track(wide: Wide, column: Column, reading: Reading) -> Reading:
    """A runout and its sd as arc length; an interval with its lower end first.

    Raises
    ------
    CellError
        If a place is not on the track.
    """
    ends, sd = [one for one in (reading.value, reading.value_to) if one], reading.sd
    if column.is_ == "runout" and column.place not in (None, "s"):
        place = str(column.place)
        if sd:
            sd = repr(max(float(wide.places.sd_along(number(end), number(sd), place)) for end in ends))
        ends = [repr(float(wide.places.arc_length(number(end), place))) for end in ends]
    ends.sort(key=float)
    return replace(reading, value=ends[0], value_to=ends[-1] if reading.value_to else "", sd=sd)
