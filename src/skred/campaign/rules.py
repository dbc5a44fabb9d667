"""The rules of the campaign format that concern more than one cell.

Each function is one table's rules and returns the problems it finds. A cell that could not be read was
reported where it was read; rules that need it pass over its row, so that one mistake is told once.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import hypot

from skred.campaign.problems import Problem
from skred.campaign.records import Sensor
from skred.campaign.tables import MOST_PROBLEMS, Row

# Others compute the same arc length in another order of additions.
ROUNDING_M = 1e-6
FASTEST_M_S = 200.0
"""Greatest front velocity that is read, m/s.

Twice that of the fastest avalanches measured, about 100 m/s; a free fall reaches it after 2 km. What lies
beyond is in another unit or a slip.
"""
SMALLEST_VELOCITY_SD, SMALLEST_RUNOUT_SD = 1e-3, 1e-4
"""Smallest standard deviation of a reading that is read: of velocities as a share of the largest one
recorded, of runouts as a share of the track's length.

The likelihood takes it for what the model is right to as well. At a thousandth of this, fronts that miss
their readings by metres a second are a million standard deviations off, and every number is lost to rounding.
"""
SENSORS, EVENTS, RECORDINGS = "sensors.csv", "events.csv", "recordings.csv"


def sensor_problems(rows: Sequence[Row], length_m: float | None) -> list[Problem]:
    """Check the sensors' ids and places; without a length, not whether these lie on the track."""
    problems = _empty(SENSORS, rows) + _repeated(SENSORS, "sensor", rows)
    for row in rows:
        if not row.has("quantity", "s_from_m", "s_to_m"):
            continue
        places = {column: row.number_or_none(column) for column in ("s_from_m", "s_to_m")}
        if row.word("quantity") == "runout":
            for column, s_m in places.items():
                if s_m is not None:
                    message = "a runout sensor has no place; leave the cell empty"
                    problems.append(problem_at(SENSORS, row, column, message))
            continue
        for column, s_m in places.items():
            if s_m is None:
                message = "a velocity needs a place; write its arc length, for a point the same one twice"
                problems.append(problem_at(SENSORS, row, column, message))
            else:
                problems += _off_track(SENSORS, row, column, s_m, length_m)
        s_from_m, s_to_m = places.values()
        if s_from_m is not None and s_to_m is not None and s_from_m > s_to_m:
            message = f"s_to_m lies above s_from_m ({s_from_m:g}); exchange them"
            problems.append(problem_at(SENSORS, row, "s_to_m", message))
    return problems


def event_problems(rows: Sequence[Row], length_m: float | None) -> list[Problem]:
    """Check the events' ids and release points; without a length, not whether these lie on the track."""
    problems = _empty(EVENTS, rows) + _repeated(EVENTS, "event", rows)
    for row in rows:
        if row.has("release_s_m"):
            problems += _off_track(EVENTS, row, "release_s_m", row.number("release_s_m"), length_m)
        problems += _release_speed_problems(row)
    return problems


def _release_speed_problems(row: Row) -> list[Problem]:
    """Check the speed with which a front starts."""
    speed, sd = (row.number_or_none(name) for name in ("release_speed_m_s", "release_speed_sd_m_s"))
    problems = []
    if speed is not None and speed > FASTEST_M_S:
        message = f"expected a speed of at most {FASTEST_M_S:g} m/s; correct it, or write it in m/s"
        problems.append(problem_at(EVENTS, row, "release_speed_m_s", message))
    if sd is not None and speed is None and "release_speed_m_s" not in row.unreadable:
        message = "the standard deviation of a speed that is not given; write release_speed_m_s, or remove it"
        problems.append(problem_at(EVENTS, row, "release_speed_sd_m_s", message))
    return problems


def recording_problems(
    rows: Sequence[Row],
    event_ids: frozenset[str] | None,
    sensor_ids: frozenset[str] | None,
    sensors: Mapping[str, Sensor],
    length_m: float | None,
) -> list[Problem]:
    """Check each reading by itself.

    Parameters
    ----------
    rows : sequence of Row
        The readings.
    event_ids, sensor_ids : frozenset of str or None
        What readings may name; None where the file with these ids could not be read.
    sensors : mapping of str to Sensor
        The sensors without a problem.
    length_m : float or None
        Length of the track, m; None where it has a problem.

    Returns
    -------
    list of Problem
        In the order of the rows.
    """
    problems: list[Problem] = []
    first_line: dict[tuple[str, str], int] = {}
    for row in rows:
        if len(problems) > MOST_PROBLEMS:
            break
        for column, known, file in (("event", event_ids, EVENTS), ("sensor", sensor_ids, SENSORS)):
            if known is not None and row.has(column) and row.word(column) not in known:
                message = f"not an id of {file}; correct it or add it there"
                problems.append(problem_at(RECORDINGS, row, column, message))
        if row.has("event", "sensor"):
            key = (row.word("event"), row.word("sensor"))
            if key in first_line:
                message = f"this event and sensor have a reading in row {first_line[key]}; remove one of them"
                problems.append(problem_at(RECORDINGS, row, "sensor", message))
            first_line.setdefault(key, row.line)
        if row.has("value", "status"):
            sensor = sensors.get(row.word("sensor")) if row.has("sensor") else None
            problems += _reading_problems(row, sensor, length_m)
    return problems + (_sd_problems(rows, sensors, length_m) if length_m is not None else [])


def _reading_problems(row: Row, sensor: Sensor | None, length_m: float | None) -> list[Problem]:
    """Check that value, status and standard deviation of one reading go together."""
    value, status = row.number_or_none("value"), row.word("status")
    if status == "not_reached" and sensor is not None and sensor.is_runout:
        message = "every avalanche has a runout; write 'missing' if it is not known"
        return [problem_at(RECORDINGS, row, "status", message)]
    problems = _value_to_problems(row, status)
    if status in ("not_reached", "missing"):
        if value is None:
            return problems
        message = f"a reading with status '{status}' carries no value; remove it or correct the status"
        return [*problems, problem_at(RECORDINGS, row, "value", message)]
    if value is None:
        what = "an observed reading needs a value" if status == "observed" else f"'{status}' needs a value"
        message = f"{what}; write it, or the status 'missing' or 'not_reached'"
        return [*problems, problem_at(RECORDINGS, row, "value", message)]
    if sensor is None:
        return problems
    for column in ("value", "value_to"):
        number = row.number_or_none(column)
        if number is not None:
            problems += _size_problems(row, column, number, sensor, length_m)
    return problems


def _value_to_problems(row: Row, status: str) -> list[Problem]:
    """Check that an interval, and nothing else, has a second end below its first."""
    value, value_to = row.number_or_none("value"), row.number_or_none("value_to")
    if status != "between":
        if value_to is None:
            return []
        message = f"a reading with status '{status}' has one value; remove value_to, or write 'between'"
        return [problem_at(RECORDINGS, row, "value_to", message)]
    if value_to is None:
        if "value_to" in row.unreadable:
            return []
        message = "'between' needs both ends; write the upper one here, or the status 'at_least'"
        return [Problem(RECORDINGS, row.line, "value_to", None, message)]
    if value is not None and value_to <= value:
        message = f"value_to must be greater than value ({value:g}); exchange or correct them"
        return [problem_at(RECORDINGS, row, "value_to", message)]
    return []


def _size_problems(
    row: Row, column: str, value: float, sensor: Sensor, length_m: float | None
) -> list[Problem]:
    """Check that a reading or a bound is a place on the track, or a speed that something can have."""
    if sensor.is_runout:
        return _off_track(RECORDINGS, row, column, value, length_m)
    if value < 0:
        message = "a front velocity is not negative; correct it, or write 'at_most' the least it can show"
        return [problem_at(RECORDINGS, row, column, message)]
    if value > FASTEST_M_S:
        message = f"expected a front velocity of at most {FASTEST_M_S:g} m/s; correct it, or write it in m/s"
        return [problem_at(RECORDINGS, row, column, message)]
    return []


def _sd_problems(rows: Sequence[Row], sensors: Mapping[str, Sensor], length_m: float) -> list[Problem]:
    """Check that standard deviations of readings and bounds are such as a model can be right to."""
    read = [
        (row, sensors[row.word("sensor")], row.number("value"))
        for row in rows
        if row.has("sensor", "value", "status")
        and row.word("sensor") in sensors
        and row.number_or_none("value") is not None
        and "sd" not in row.unreadable
    ]
    possible = [value for _, sensor, value in read if not sensor.is_runout and value <= FASTEST_M_S]
    fastest = max(possible, default=0.0)
    least = {True: SMALLEST_RUNOUT_SD * length_m, False: SMALLEST_VELOCITY_SD * fastest}
    problems = list[Problem]()
    for row, sensor, value in read:
        problems += _sd_problem(row, sensor, value, least[sensor.is_runout])
    return problems[:MOST_PROBLEMS]


def _sd_problem(row: Row, sensor: Sensor, value: float, least: float) -> list[Problem]:
    """Check the standard deviation of one reading or bound."""
    stated = row.number_or_none("sd")
    sd = hypot(sensor.relative_sd * value, sensor.absolute_sd) if stated is None else stated
    if sd >= least:
        return []
    at_least = (
        f"{least:.2g} m, 1/10000 of the track"
        if sensor.is_runout
        else (f"{least:.2g} m/s, 1/1000 of the largest velocity")
    )
    message = f"the reading's standard deviation is {sd:g}, expected at least {at_least}"
    if stated is not None:
        return [problem_at(RECORDINGS, row, "sd", f"{message}; write how far readings of this kind are off")]
    message += f"; state one, or give sensor '{sensor.id}' an absolute_sd"
    return [Problem(RECORDINGS, row.line, "sd", None, message)]


def reference_problems(reference_s_m: float | None, row: int | None, length_m: float | None) -> list[Problem]:
    """Check that the zero for reports lies on the track."""
    if reference_s_m is None or length_m is None or _is_on_track(reference_s_m, length_m):
        return []
    message = f"expected an arc length on the track, 0 to {length_m:.2f} m; correct it or remove the key"
    return [Problem("campaign.toml", row, "reference_s_m", f"{reference_s_m:g}", message)]


def _empty(file: str, rows: Sequence[Row]) -> list[Problem]:
    """Check that a table has rows."""
    return [] if rows else [Problem(file, None, None, None, "the table has no rows; write at least one")]


def _repeated(file: str, column: str, rows: Iterable[Row]) -> list[Problem]:
    """Check that ids are unique."""
    problems = []
    first_line: dict[str, int] = {}
    for row in rows:
        if row.has(column):
            line = first_line.setdefault(row.word(column), row.line)
            if line != row.line:
                message = f"the id already stands in row {line}; give each its own"
                problems.append(problem_at(file, row, column, message))
    return problems


def _is_on_track(s_m: float, length_m: float) -> bool:
    return -ROUNDING_M <= s_m <= length_m + ROUNDING_M


def _off_track(file: str, row: Row, column: str, s_m: float, length_m: float | None) -> list[Problem]:
    """Check that a place lies on the track."""
    if length_m is None or _is_on_track(s_m, length_m):
        return []
    return [
        problem_at(
            file, row, column, f"expected an arc length on the track, 0 to {length_m:.2f} m; correct it"
        )
    ]


def problem_at(file: str, row: Row, column: str, message: str) -> Problem:
    """Return a problem with a cell that could be read."""
    value = row.cells[column]
    found = value if isinstance(value, str) else "" if value is None else repr(value)
    return Problem(file, row.line, column, found, message)
