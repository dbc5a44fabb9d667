"""What each column of a wide table is: as declared, as the sensors' table has it, or as its name says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skred.campaign import CampaignError, Problem
from skred.campaign.problems import shown
from skred.importing.draft import DraftTable
from skred.importing.mapping import Column, Runout, Velocity
from skred.importing.mapping import Mapping as Declared
from skred.importing.meaning import base_and_unit, place_in, recognised
from skred.importing.questions import Question, Unclear
from skred.importing.sheet import Sheet

FORMS = (
    "event, release, release_sd, front_velocity at=S, front_velocity from=S to=S, "
    "runout place=s|x|altitude|reference (bound=at_least|at_most for bounds), sd of=SENSOR, "
    "covariate name=NAME_UNIT, ignore"
)
"""The meanings that a column can have, as the option takes them."""


RESERVED = ("event", "release_s_m", "release_sd_m")
"""Columns of events.csv that have meanings of their own here; its release speeds are given by their names."""


@dataclass(frozen=True)
class Meaning:
    """What a column is, and whether somebody said so."""

    column: Column
    declared: bool


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
        for question in _questions(sheet, columns, declared)
    ]
    questions += _release_question(sheets, found, declared)
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
    return [{name: _with_defaults(one, declared) for name, one in columns.items()} for columns in settled]


def by_sensor(meanings: Mapping[str, Meaning]) -> dict[str, dict[str, Column]]:
    """The columns of readings by their sensors' ids."""
    found = dict[str, dict[str, Column]]()
    for name, one in meanings.items():
        if one.column.is_ in ("front_velocity", "runout"):
            found.setdefault(sensor_id(name, one.column), {})[name] = one.column
    return found


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
            filled[name] = Meaning(column.model_copy(update=update), settled[name].declared)
    return filled


def sensor_id(name: str, column: Column) -> str:
    """Id of a column's sensor: as declared, or the column's name without its unit."""
    return column.sensor or base_and_unit(name)[0]


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
    cells = [text for _, text in sheet.cells(name)]
    by_name = recognised(name, cells, ids)
    if name in declared:
        column = declared[name]
        if column.unit is None and by_name is not None and by_name.is_ == column.is_:
            column = column.model_copy(update={"unit": by_name.unit})  # it stands in the name
        return Meaning(column, True)
    sensor, is_exact = _sensor_of(name, known)
    if sensor is not None and (by_name is None or by_name.is_ in (sensor.is_, "event")):
        # The unit and the kind of place are not in the sensors' table: they stand in the column's name.
        extra: dict[str, Any] = place_in(name) if sensor.is_ == "runout" else {}
        if by_name is not None and by_name.unit is not None:
            extra["unit"] = by_name.unit
        return Meaning(sensor.model_copy(update=extra), is_exact)
    if by_name is None:
        return None
    return Meaning(by_name, name in ("event", "release_s_m", "release_sd_m") or by_name.name == name)


def _sensor_of(name: str, known: Mapping[str, Column]) -> tuple[Column | None, bool]:
    """The sensor that a column is named for, and whether it has just that name, but for a unit."""
    for same in (name, base_and_unit(name)[0]):
        if same in known:
            return known[same], True
    for sensor, column in known.items():
        # Such as "stop altitude [m]" for a runout of the sensor "stop".
        if column.is_ == "runout" and name.casefold().startswith(
            (f"{sensor} ".casefold(), f"{sensor}_".casefold())
        ):
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


def _questions(sheet: Sheet, found: Mapping[str, Meaning | None], declared: Declared) -> list[Question]:
    """What is open of the columns."""
    questions = list[Question]()

    def ask(
        key: tuple[str, ...], column: str, text: str, example: str, choices: tuple[str, ...] = ()
    ) -> None:
        where = f"{sheet.file}, column {shown(column)}" if column else sheet.file
        option = "--runout" if key == ("runout", "place") else ""
        questions.append(Question(key, where, text, choices, example, option))

    for name, one in found.items():
        if one is None:
            sample = next((text for _, text in sheet.cells(name) if text), "nothing")
            ask(
                ("columns", name),
                name,
                f"what is it? (first cell: '{shown(sample, 30)}'; one of: {FORMS})",
                "MEANING",
            )
            continue
        column = one.column
        if column.is_ == "front_velocity":
            if column.at is None and column.from_ is None:
                unit = f" unit={column.unit}" if column.unit else ""
                form = f"front_velocity at=PLACE{unit}"
                text = (
                    "a front velocity: where is its sensor? Arc length s [m], for a span from=S to=S "
                    "(or give --sensors FILE with an id for each column)"
                )
                ask(("columns", name), name, text, form)
            elif column.unit is None and declared.velocity.unit is None:
                ask(("velocity", "unit"), name, "the unit of velocities", "", ("m/s", "km/h"))
            if column.relative_sd is None and declared.velocity.relative_sd is None:
                text = "standard deviation of a velocity: the part that grows with it (0.1: 10 %; 0: none)"
                ask(("velocity", "relative_sd"), name, text, "0.1")
            if column.absolute_sd is None and declared.velocity.absolute_sd is None:
                text = "standard deviation of a velocity: the part that is always the same [m/s]"
                ask(("velocity", "absolute_sd"), name, text, "1")
        elif column.is_ == "runout":
            if column.place is None and declared.runout.place is None:
                text = (
                    "how is the runout given: arc length s, horizontal distance x, altitude on the track, or "
                    "distance along the track from the reference, downhill positive?"
                )
                ask(("runout", "place"), name, text, "", ("s", "x", "altitude", "reference"))
            if column.absolute_sd is None and declared.runout.absolute_sd is None:
                text = "standard deviation of a runout along the track [m]"
                ask(("runout", "absolute_sd"), name, text, "15")
        elif column.is_ == "release" and column.place is None and declared.release.place is None:
            text = "how is the release given: arc length s, horizontal distance x or altitude on the track?"
            ask(("release", "place"), name, text, "", ("s", "x", "altitude", "reference"))
    return questions


def _release_question(
    sheets: Sequence[Sheet], found: Sequence[Mapping[str, Meaning | None]], declared: Declared
) -> list[Question]:
    """Where avalanches start, if no column of any table says so."""
    columns = [one for table in found for one in table.values()]
    if None in columns or declared.release.s_m is not None:
        return []
    if any(one is not None and one.column.is_ == "release" for one in columns):
        return []
    text = "no column says where avalanches start: arc length of their release [m], the same for all"
    return [Question(("release", "s_m"), ", ".join(sheet.file for sheet in sheets), text, (), "0")]


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
        return Meaning(one.column.model_copy(update={"place": place}), one.declared)
    else:
        return one
    update = {}
    for key in ("unit", "place", "relative_sd", "absolute_sd"):
        for value in (getattr(one.column, key), getattr(defaults, key), last.get(key)):
            if value is not None:
                update[key] = value
                break
    return Meaning(one.column.model_copy(update=update), one.declared)
