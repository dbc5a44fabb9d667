"""What each column of a wide table is: as declared, as the sensors' table has it, or as its name says."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from skred.campaign import CampaignError, Problem
from skred.campaign.problems import shown
from skred.importing.column_meaning import Meaning, by_sensor
from skred.importing.column_questions import column_questions, release_question
from skred.importing.draft import DraftTable
from skred.importing.mapping import Column, Runout, Velocity
from skred.importing.mapping import Mapping as Declared
from skred.importing.meaning import place_in, recognised, says_where
from skred.importing.questions import Unclear
from skred.importing.sheet import Sheet
from skred.importing.units import OF_KIND, base_and_unit, unit_of

RESERVED = ("event", "release_s_m", "release_sd_m")
"""Columns of events.csv that have meanings of their own here; its release speeds are given by their names."""


def meanings(
    sheets: Sequence[Sheet], declared: Declared, sensors: DraftTable | None
) -> list[dict[str, Meaning]]:
    """The meaning of every column of every table.

    Parameters
    ----------
    sheets : sequence of Sheet
    declared : Mapping
    sensors : DraftTable or None
        A table as sensors.csv; a column named as one of its sensors is that sensor.

    Raises
    ------
    CampaignError
        If a declared column is in no table, no column or several name the avalanches, a column of standard
        deviations belongs to no sensor, or several columns hold the same readings.
    Unclear
        With every column whose meaning is open.
    """
    known = _of_sensors(sensors)
    _require_declared(sheets, declared)
    found = [_of_sheet(sheet, declared.columns_of(sheet.key), known) for sheet in sheets]
    questions = [
        question
        for sheet, columns in zip(sheets, found, strict=True)
        for question in column_questions(sheet, columns, declared)
    ]
    questions += release_question(sheets, found, declared)
    settled = [{name: one for name, one in columns.items() if one is not None} for columns in found]
    problems = [
        problem
        for sheet, columns in zip(sheets, settled, strict=True)
        for problem in _problems(sheet, columns)
    ]
    if not any(_ids(columns) for columns in settled):
        message = "no column is a front velocity or a runout; declare one with --column"
        problems.append(Problem(sheets[0].file, sheets[0].header_line, None, None, message))
    if problems and not questions:
        raise CampaignError(problems)
    if questions:
        raise Unclear(questions)
    complete = [{name: _with_defaults(one, declared) for name, one in columns.items()} for columns in settled]
    return [_with_units_of_sds(columns) for columns in complete]


def _ids(columns: Mapping[str, Meaning]) -> tuple[str, ...]:
    return tuple(by_sensor(columns))


def _of_sheet(
    sheet: Sheet, declared: Mapping[str, Column], known: Mapping[str, Column]
) -> dict[str, Meaning | None]:
    """What each column of one table is; None where that is not clear."""
    first = {name: _meaning(name, sheet, declared, known, tuple(known)) for name in sheet.columns}
    # Once the sensors are known, columns of their standard deviations are.
    ids = _ids({name: one for name, one in first.items() if one is not None})
    found = {name: _meaning(name, sheet, declared, known, ids) for name in sheet.columns}
    return _described_alike(found)


def _described_alike(found: Mapping[str, Meaning | None]) -> dict[str, Meaning | None]:
    """Columns of one sensor: what only one of them says of it holds for all."""
    shared = ("at", "from_", "to", "place", "place_sd_m", "unit", "relative_sd", "absolute_sd")
    settled = {name: one for name, one in found.items() if one is not None}
    filled = dict(found)
    for columns in by_sensor(settled).values():
        if len(columns) == 1:
            continue
        said: dict[str, Any] = {}
        for column in columns.values():
            said |= {
                key: value
                for key in shared
                if (value := getattr(column, key)) is not None and key not in said
            }
        for name, column in columns.items():
            update = {key: value for key, value in said.items() if getattr(column, key) is None}
            filled[name] = replace(settled[name], column=column.model_copy(update=update))
    return filled


def _of_sensors(sensors: DraftTable | None) -> dict[str, Column]:
    """Columns named as sensors."""
    found = dict[str, Column]()
    for _, row in sensors.rows if sensors is not None else ():
        name, kind = row.get("sensor", ""), row.get("quantity", "")
        if kind not in ("front_velocity", "runout"):
            continue
        content: dict[str, Any] = {"is": kind, "sensor": name}
        content |= {key: row[key] for key in ("relative_sd", "absolute_sd", "place_sd_m") if row.get(key)}
        start, end = row.get("s_from_m", ""), row.get("s_to_m", "")
        if kind == "front_velocity" and start and end:
            content |= {"at": start} if float(start) == float(end) else {"from": start, "to": end}
            content["place"] = "s"
        found[name] = Column.model_validate(content)
    return found


def _meaning(
    name: str,
    sheet: Sheet,
    declared: Mapping[str, Column],
    known: Mapping[str, Column],
    ids: tuple[str, ...],
) -> Meaning | None:
    """What one column is; None where that is not clear."""
    by_name = recognised(name, [text for _, text in sheet.cells(name)], ids)
    if name in declared:
        return _in_its_unit(name, declared[name], is_declared=True)
    sensor, is_exact = _sensor_of(name, known)
    if sensor is not None:
        # The kind of place is not in the sensors' table: it stands in the column's name.
        place = place_in(name) if sensor.is_ == "runout" else {}
        return _in_its_unit(name, sensor.model_copy(update=place), is_declared=is_exact)
    if by_name is None:
        return None
    is_of_format = name in ("event", "release_s_m", "release_sd_m") or by_name.name == name
    return _in_its_unit(name, by_name, is_declared=is_of_format)


def _in_its_unit(name: str, column: Column, *, is_declared: bool) -> Meaning:
    """A column in the unit that its name says, where it was not declared otherwise."""
    if column.unit is not None:
        return Meaning(column, is_declared)
    unit = unit_of(column.is_, name)
    if unit is None:
        return Meaning(column, is_declared, base_and_unit(name)[1])
    return Meaning(column.model_copy(update={"unit": unit or None}), is_declared)


def _sensor_of(name: str, known: Mapping[str, Column]) -> tuple[Column | None, bool]:
    """The sensor that a column is named for, and whether it has just that name, but for a unit."""
    base = base_and_unit(name)[0]
    for same in (name, base):
        if same in known:
            return known[same], True
    words = base.casefold().replace("_", " ")
    for sensor, column in known.items():
        # Such as "stop altitude [m]" for a runout of the sensor "stop".
        start = sensor.casefold().replace("_", " ")
        if column.is_ == "runout" and words.startswith(start) and says_where(words.removeprefix(start)):
            return column, False
    return None, False


def _require_declared(sheets: Sequence[Sheet], declared: Declared) -> None:
    """Refuse tables without a column that was declared and holds recordings."""
    needed = ("event", "release", "front_velocity", "runout")
    there = {name for sheet in sheets for name in sheet.columns}
    message = "declared, and not in the table; correct one of the two"
    problems = [
        Problem(sheets[0].file, sheets[0].header_line, name, None, message)
        for name, column in declared.columns.items()
        if name not in there and column.is_ in needed
    ]
    for sheet in sheets:
        own = declared.columns_of(sheet.key)
        problems += [
            Problem(sheet.file, sheet.header_line, name, None, message)
            for name, column in own.items()
            if name not in declared.columns and name not in sheet.columns and column.is_ in needed
        ]
    if problems:
        raise CampaignError(problems)


def _problems(sheet: Sheet, found: Mapping[str, Meaning]) -> list[Problem]:
    """What cannot be as it is declared or recognised."""
    problems = []
    ids = _ids(found)
    for kind, what in (
        ("event", "names the avalanches"),
        ("release", "is the release"),
        ("release_sd", "is its sd"),
    ):
        names = [name for name, one in found.items() if one.column.is_ == kind]
        if len(names) > 1 or (kind == "event" and not names):
            count = f"columns {', '.join(names)}" if names else "no column"
            message = f'{count}: exactly one {what}; add --column "NAME={kind}", or "NAME=ignore" for others'
            problems.append(Problem(sheet.file, sheet.header_line, None, None, message))
    for name, one in found.items():
        if one.column.is_ == "sd" and one.column.of not in ids:
            message = f"of='{one.column.of}' is no sensor; there are: {', '.join(ids) or 'none'}"
            problems.append(Problem(sheet.file, sheet.header_line, name, None, message))
    problems += _unit_problems(sheet, found)
    problems += _covariate_problems(sheet, found)
    for sensor, columns in by_sensor(found).items():
        bounds = [column.bound for column in columns.values()]
        if len(set(bounds)) < len(bounds):
            listed = ", ".join(f"'{shown(name)}'" for name in columns)
            message = (
                f"the columns {listed} are all readings of sensor '{sensor}'; give them different ids with "
                "sensor=, or where they hold bounds add bound=at_least and bound=at_most"
            )
            problems.append(Problem(sheet.file, sheet.header_line, None, None, message))
    return problems


def _unit_problems(sheet: Sheet, found: Mapping[str, Meaning]) -> list[Problem]:
    """Standard deviations in a unit that their readings cannot have."""
    kinds = {sensor: next(iter(columns.values())).is_ for sensor, columns in by_sensor(found).items()}
    problems = []
    for name, one in found.items():
        kind = kinds.get(one.column.of or "")
        if one.column.is_ == "sd" and kind and one.column.unit not in (None, *OF_KIND[kind]):
            message = (
                f"its unit is {one.column.unit}, and sensor '{one.column.of}' is a {kind}: expected "
                f"{' or '.join(OF_KIND[kind])}; correct the unit, or of="
            )
            problems.append(Problem(sheet.file, sheet.header_line, name, None, message))
    return problems


def _covariate_problems(sheet: Sheet, found: Mapping[str, Meaning]) -> list[Problem]:
    """Covariates that would become one column of events.csv, or one that has another meaning there."""
    taken = dict.fromkeys(RESERVED, "the column of that name in events.csv")
    problems = []
    for name, one in found.items():
        if one.column.is_ != "covariate":
            continue
        new = one.column.name or name
        if new in taken:
            message = (
                f"it would be called '{shown(new)}', as is {taken[new]}; give it another name with --column "
                '"NAME=covariate name=OTHER", or leave one out with "NAME=ignore"'
            )
            problems.append(Problem(sheet.file, sheet.header_line, name, None, message))
        taken.setdefault(new, f"column '{shown(name)}'")
    return problems


def _with_defaults(one: Meaning, declared: Declared) -> Meaning:
    """A column with what holds for all of its kind."""
    defaults: Velocity | Runout
    if one.column.is_ == "front_velocity":
        defaults = declared.velocity
        last: dict[str, Any] = {"unit": "m/s", "place": "s"}
    elif one.column.is_ == "runout":
        defaults, last = declared.runout, {"unit": "m", "relative_sd": 0.0}
    elif one.column.is_ == "release":
        place = one.column.place or declared.release.place
        return replace(one, column=one.column.model_copy(update={"place": place}))
    else:
        return one
    update = {}
    for key in ("unit", "place", "relative_sd", "absolute_sd"):
        for value in (getattr(one.column, key), getattr(defaults, key), last.get(key)):
            if value is not None:
                update[key] = value
                break
    return replace(one, column=one.column.model_copy(update=update))


def _with_units_of_sds(found: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """Standard deviations whose unit nobody said have that of their readings: it is the format's own."""
    units = {sensor: next(iter(columns.values())).unit for sensor, columns in by_sensor(found).items()}
    return {
        name: replace(one, column=one.column.model_copy(update={"unit": units[one.column.of or ""]}))
        if one.column.is_ == "sd" and one.column.unit is None
        else one
        for name, one in found.items()
    }
