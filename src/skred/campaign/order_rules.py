"""The rules that hold the readings of one event together: where it was seen, stopped, and began.

Order along the track is physics: a front is nowhere above its release, and nowhere below its stop.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import hypot

from skred.campaign.problems import Problem
from skred.campaign.records import Sensor
from skred.campaign.rules import RECORDINGS, problem_at
from skred.campaign.tables import Row

LARGEST_SDS = 4.0
"""Standard deviations by which two readings of one event may contradict each other."""


def order_problems(
    rows: Sequence[Row], sensors: Mapping[str, Sensor], releases: Mapping[str, Row]
) -> list[Problem]:
    """Check the order along the track of what is known of each event.

    Parameters
    ----------
    rows : sequence of Row
        The readings.
    sensors : mapping of str to Sensor
        The sensors without a problem.
    releases : mapping of str to Row
        The events' rows, as far as their releases could be read.
    """
    problems = not_reached_problems(rows, sensors)
    return problems + _stop_problems(rows, sensors, releases) + _start_problems(rows, sensors, releases)


def _moving(rows: Sequence[Row], sensors: Mapping[str, Sensor]) -> Iterator[tuple[Row, Sensor]]:
    """Readings that say that a front moved, and their sensors."""
    for row in rows:
        sensor = _velocity_sensor(row, sensors)
        if sensor is not None and sensor.s_from_m >= 0.0 and has_speed(row):
            yield row, sensor


def _stop_problems(
    rows: Sequence[Row], sensors: Mapping[str, Sensor], releases: Mapping[str, Row]
) -> list[Problem]:
    """Check that no front stopped above a place where it moved, nor above its release."""
    lowest: dict[str, tuple[float, Row]] = {}
    for row, sensor in _moving(rows, sensors):
        event = row.word("event")
        if event not in lowest or sensor.s_from_m > lowest[event][0]:
            lowest[event] = sensor.s_from_m, row
    problems = []
    for row in rows:
        one = sensors.get(row.word("sensor")) if row.has("event", "sensor", "status") else None
        stop_m = None if one is None else _stop(row, one)
        if one is None or stop_m is None:
            continue
        event, reach_m = row.word("event"), LARGEST_SDS * _sd(row, one)
        column = "value_to" if row.word("status") == "between" else "value"
        place_m, seen = lowest.get(event, (-1.0, row))
        if stop_m + reach_m < place_m:
            message = (
                f"event '{event}' moved at {seen.number('value'):g} m/s at s = {place_m:g} m (sensor "
                f"'{seen.word('sensor')}', row {seen.line}), {place_m - stop_m:.4g} m below this stop;"
                " expected a runout as arc length s, not an elevation or a map distance; correct one of"
                " the two"
            )
            problems.append(problem_at(RECORDINGS, row, column, message))
            continue
        release = releases.get(event)
        if release is None:
            continue
        if stop_m + hypot(reach_m, release_reach(release)) < release.number("release_s_m"):
            message = (
                f"event '{event}' would have stopped above its release at s = "
                f"{release.number('release_s_m'):g} m (events.csv, row {release.line}); correct one of"
                " the two"
            )
            problems.append(problem_at(RECORDINGS, row, column, message))
    return problems


def _start_problems(
    rows: Sequence[Row], sensors: Mapping[str, Sensor], releases: Mapping[str, Row]
) -> list[Problem]:
    """Check that no front has a speed above its release."""
    problems = []
    for row, sensor in _moving(rows, sensors):
        release = releases.get(row.word("event"))
        if release is None:
            continue
        place_m = release.number("release_s_m")
        if sensor.s_from_m + release_reach(release) < place_m:
            message = (
                f"event '{row.word('event')}' starts further down, at s = {place_m:g} m (events.csv, row "
                f"{release.line}), and so has no speed at s = {sensor.s_from_m:g} m; correct one of the two"
            )
            problems.append(problem_at(RECORDINGS, row, "value", message))
    return problems


def _stop(row: Row, sensor: Sensor) -> float | None:
    """The lowest place, but for errors, at which a reading lets the front stop; None where it says none."""
    if not sensor.is_runout or row.word("status") not in ("observed", "at_least", "at_most", "between"):
        return None
    return row.number_or_none("value_to" if row.word("status") == "between" else "value")


def _sd(row: Row, sensor: Sensor) -> float:
    """Standard deviation of a runout."""
    stated = row.number_or_none("sd")
    value = row.number_or_none("value") or 0.0
    return hypot(sensor.relative_sd * value, sensor.absolute_sd) if stated is None else stated


def release_reach(release: Row) -> float:
    """How far a release may be from where it was noted, m."""
    return LARGEST_SDS * (release.number_or_none("release_sd_m") or 0.0)


def not_reached_problems(rows: Sequence[Row], sensors: Mapping[str, Sensor]) -> list[Problem]:
    """Check that no event has a positive velocity below a sensor that it did not reach.

    The front stopped above that sensor (a span: above its ``s_to_m``), so nothing that starts there or
    further down can have seen it.
    """
    uppermost: dict[str, tuple[float, Row]] = {}
    for row in rows:
        sensor = _velocity_sensor(row, sensors)
        if sensor is not None and row.word("status") == "not_reached":
            known = uppermost.get(row.word("event"))
            if known is None or sensor.s_to_m < known[0]:
                uppermost[row.word("event")] = (sensor.s_to_m, row)
    problems = []
    for row in rows:
        sensor = _velocity_sensor(row, sensors)
        if sensor is None or row.word("event") not in uppermost or not has_speed(row):
            continue
        stop_m, not_reached = uppermost[row.word("event")]
        if sensor.s_from_m >= stop_m:
            message = (
                f"event '{row.word('event')}' did not reach sensor '{not_reached.word('sensor')}' (row "
                f"{not_reached.line}), so it has no speed here, further down; correct one of the two"
            )
            problems.append(problem_at(RECORDINGS, row, "value", message))
    return problems


def has_speed(row: Row) -> bool:
    """Whether a reading of velocity says that the front moved there."""
    if row.word("status") not in ("observed", "at_least", "between"):
        return False
    return (row.number_or_none("value") or 0.0) > 0.0


def _velocity_sensor(row: Row, sensors: Mapping[str, Sensor]) -> Sensor | None:
    """Return a reading's sensor if it records velocity and the reading's cells could be read."""
    if not row.has("event", "sensor", "status"):
        return None
    sensor = sensors.get(row.word("sensor"))
    return None if sensor is None or sensor.is_runout else sensor
