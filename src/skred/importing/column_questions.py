"""What is open of the columns of wide tables, as questions."""

import shlex
from collections.abc import Iterator, Mapping, Sequence

from skred.campaign.problems import shown
from skred.importing.column_meaning import Meaning, by_sensor
from skred.importing.mapping import Column
from skred.importing.mapping import Mapping as Declared
from skred.importing.questions import Question
from skred.importing.sheet import Sheet
from skred.importing.units import OF_KIND

FORMS = (
    "event, release, release_sd, front_velocity at=S, front_velocity from=S to=S, "
    "runout place=s|x|altitude|reference (bound=at_least|at_most for bounds), "
    "sd of=SENSOR (unit=m/s|km/h|m|km), covariate name=NAME_UNIT, ignore"
)
"""The meanings that a column can have, as the option takes them."""
PLACES = ("s", "x", "altitude", "reference")


def column_questions(sheet: Sheet, found: Mapping[str, Meaning | None], declared: Declared) -> list[Question]:
    """What is open of the columns of one table."""
    questions = [
        question for name, one in found.items() for question in _of_column(sheet, name, one, declared)
    ]
    settled = {name: one for name, one in found.items() if one is not None}
    for sensor, columns in by_sensor(settled).items():
        for name, one in settled.items():
            if one.column.is_ == "sd" and one.column.of == sensor and not one.foreign_unit:
                questions += _unit_of_sd(_where(sheet, name), name, one.column, [*columns.values()], declared)
    return questions


def _where(sheet: Sheet, name: str) -> str:
    return f"{sheet.file}, column {shown(name)}"


def _of_column(sheet: Sheet, name: str, one: Meaning | None, declared: Declared) -> Iterator[Question]:
    """What is open of one column."""
    where = _where(sheet, name)
    if one is None:
        sample = next((text for _, text in sheet.cells(name) if text), "nothing")
        text = f"what is it? (first cell: '{shown(sample, 30)}'; one of: {FORMS})"
        yield Question(("columns", name), where, text, (), "MEANING")
        return
    if one.foreign_unit:
        yield _unit_question(where, name, one)
    elif one.column.is_ == "front_velocity":
        yield from _place_and_unit(where, name, one, declared)
    if one.column.is_ == "front_velocity":
        yield from _sd_of_velocity(where, one.column, declared)
    elif one.column.is_ == "runout":
        yield from _of_runout(where, one.column, declared)
    elif one.column.is_ == "release" and one.column.place is None and declared.release.place is None:
        text = "how is the release given: arc length s, horizontal distance x or altitude on the track?"
        yield Question(("release", "place"), where, text, PLACES)


def _unit_question(where: str, name: str, one: Meaning) -> Question:
    """A unit that no reading of its kind has: what its numbers are is for a person to say."""
    units = OF_KIND[one.column.is_]
    text = (
        f"its unit '{shown(one.foreign_unit, 30)}' is none of {', '.join(units)}: turn its numbers into one "
        "of these and say which, say what else it is (covariate name=NAME_UNIT), or leave it out (ignore)"
    )
    if one.column.is_ == "sd":
        text += f"; a share of every reading is relative_sd= of '{shown(one.column.of or '')}'"
    return Question(("columns", name), where, text, (), f"{_as_option(one.column)} unit={'|'.join(units)}")


def _unit_of_sd(
    where: str, name: str, column: Column, readings: Sequence[Column], declared: Declared
) -> Iterator[Question]:
    """The unit of standard deviations, where neither they nor the format say it."""
    kind = readings[0].is_
    of_all = declared.velocity.unit if kind == "front_velocity" else declared.runout.unit
    unit = readings[0].unit or of_all
    if column.unit is not None or unit in (None, OF_KIND[kind][0]):
        return  # of velocities without a unit, that is asked about first
    text = f"the unit of these standard deviations; the readings of '{shown(column.of or '')}' are in {unit}"
    yield Question(("columns", name), where, text, (), f"{_as_option(column)} unit={'|'.join(OF_KIND[kind])}")


def _as_option(column: Column) -> str:
    """What is known of a column, in the words that declare it."""
    kind, *keys = column.model_dump(by_alias=True, exclude_none=True).items()
    words = [f"{key}={value:.12g}" if isinstance(value, float) else f"{key}={value}" for key, value in keys]
    if column.is_ == "front_velocity" and column.at is None and column.from_ is None:
        words.append("at=PLACE")
    return shlex.join([str(kind[1]), *words])


def _place_and_unit(where: str, name: str, one: Meaning, declared: Declared) -> Iterator[Question]:
    """Where a velocity is read, and its unit."""
    column = one.column
    if column.at is None and column.from_ is None:
        unit = f" unit={column.unit}" if column.unit else ""
        text = (
            "a front velocity: where is its sensor? Arc length s [m], for a span from=S to=S "
            "(or give --sensors FILE with an id for each column)"
        )
        if not one.declared:
            text += "; if it is another speed, such as of the wind: covariate name=NAME_UNIT"
        yield Question(("columns", name), where, text, (), f"front_velocity at=PLACE{unit}")
    elif column.unit is None and declared.velocity.unit is None:
        yield Question(("velocity", "unit"), where, "the unit of velocities", ("m/s", "km/h"))


def _sd_of_velocity(where: str, column: Column, declared: Declared) -> Iterator[Question]:
    """How well a velocity is read."""
    if column.relative_sd is None and declared.velocity.relative_sd is None:
        text = "standard deviation of a velocity: the part that grows with it (0.1: 10 %; 0: none)"
        yield Question(("velocity", "relative_sd"), where, text, (), "0.1")
    if column.absolute_sd is None and declared.velocity.absolute_sd is None:
        text = "standard deviation of a velocity: the part that is always the same [m/s]"
        yield Question(("velocity", "absolute_sd"), where, text, (), "1")


def _of_runout(where: str, column: Column, declared: Declared) -> Iterator[Question]:
    """How a runout is given, and how well it is known."""
    if column.place is None and declared.runout.place is None:
        text = (
            "how is the runout given: arc length s, horizontal distance x, altitude on the track, or "
            "distance along the track from the reference, downhill positive?"
        )
        yield Question(("runout", "place"), where, text, PLACES, "", "--runout")
    if column.absolute_sd is None and declared.runout.absolute_sd is None:
        text = "standard deviation of a runout along the track [m]"
        yield Question(("runout", "absolute_sd"), where, text, (), "15")


def release_question(
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
