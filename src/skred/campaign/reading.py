"""Read a campaign: five files in, a `Campaign` or every problem out."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from skred.campaign import cells, rules
from skred.campaign.description import Description, read_description
from skred.campaign.fall_rules import fall_problems
from skred.campaign.order_rules import order_problems
from skred.campaign.problems import CampaignError, Problem
from skred.campaign.records import Campaign, Event, Quantity, Sensor, Status, Track
from skred.campaign.tables import (
    MOST_PROBLEMS,
    OTHER_SEPARATOR,
    Column,
    ReadCell,
    Row,
    Table,
    read_table,
)
from skred.campaign.track_rules import TRACK as TRACK_FILE
from skred.campaign.track_rules import track_problems

# Events times sensors: the arrays of a campaign hold one number for each pair.
MOST_READINGS = 5_000_000

_RESULTS = {
    "summary.json": "calibrate",
    "compare.json": "compare",
    "identify.json": "identify",
    "verdict.json": "diagnose",
    "prediction.json": "predict",
    "scorecard.json": "prove",
}
"""Documents that commands write, which a campaign is mistaken for."""

TRACK = (
    Column("x_m", cells.coordinate),
    Column("z_m", cells.number),
    Column("width_m", cells.positive, required=False),
)
SENSORS = (
    Column("sensor", cells.word),
    Column("quantity", cells.quantity),
    Column("s_from_m", cells.optional_number),
    Column("s_to_m", cells.optional_number),
    Column("relative_sd", cells.not_negative),
    Column("absolute_sd", cells.not_negative),
    Column("place_sd_m", cells.optional_positive, required=False),
)
EVENTS = (
    Column("event", cells.word),
    Column("release_s_m", cells.number),
    Column("release_sd_m", cells.optional_positive, required=False),
    Column("release_speed_m_s", cells.optional_not_negative, required=False),
    Column("release_speed_sd_m_s", cells.optional_positive, required=False),
)
RECORDINGS = (
    Column("event", cells.word),
    Column("sensor", cells.word),
    Column("value", cells.reading),
    Column("value_to", cells.optional_number, required=False),
    Column("sd", cells.optional_positive, required=False),
    Column("status", cells.status),
)


def read_campaign(folder: Path) -> Campaign:
    """Read and check a campaign.

    Parameters
    ----------
    folder : Path
        Folder with ``campaign.toml``, ``track.csv``, ``sensors.csv``, ``events.csv`` and ``recordings.csv``;
        other files in it are not looked at.

    Returns
    -------
    Campaign
        Its sensors and events in the order of the files. A reading that has no row is missing.

    Raises
    ------
    CampaignError
        With every problem of all five files.
    """
    folder = Path(folder)
    _require_folder(folder)
    description, reference_row, problems = read_description(folder)
    track_table = read_table(folder, TRACK_FILE, TRACK)
    sensor_table = read_table(folder, rules.SENSORS, SENSORS)
    event_table = read_table(folder, rules.EVENTS, EVENTS, _covariate_reader)
    recording_table = read_table(folder, rules.RECORDINGS, RECORDINGS)

    moving = any((row.number_or_none("release_speed_m_s") or 0.0) > 0 for row in event_table.rows)
    track, of_track = _track(track_table, may_be_level=moving)
    length_m = track.length_m if track else None
    if description is not None:
        problems += rules.reference_problems(description.reference_s_m, reference_row, length_m)
    problems += of_track
    problems += sensor_table.problems
    if sensor_table.is_usable:
        problems += rules.sensor_problems(sensor_table.rows, length_m)
    problems += event_table.problems
    if event_table.is_usable:
        problems += rules.event_problems(event_table.rows, length_m)
    sensors = _sensors(sensor_table.rows)
    problems += recording_table.problems
    if recording_table.is_usable:
        by_id = {sensor.id: sensor for sensor in sensors}
        event_ids, sensor_ids = _ids(event_table, "event"), _ids(sensor_table, "sensor")
        problems += rules.recording_problems(recording_table.rows, event_ids, sensor_ids, by_id, length_m)
        releases = _releases(event_table, length_m)
        problems += order_problems(recording_table.rows, by_id, releases)
        if track is not None:
            problems += fall_problems(recording_table.rows, by_id, releases, track)
    problems += _too_many(event_table, sensor_table)
    if problems or description is None or track is None:
        raise CampaignError(_bounded(_in_order(_separator_once(problems))))
    return _campaign(description, track, sensors, _events(event_table), recording_table.rows)


def _require_folder(folder: Path) -> None:
    """Refuse a path that is no folder."""
    try:
        is_folder = folder.is_dir()
    except (OSError, ValueError):
        is_folder = False
    if not is_folder:
        message = "expected a folder with the five files of a campaign; correct the path"
        raise CampaignError([Problem(str(folder), None, None, None, message)])
    if not (folder / "campaign.toml").is_file() and (commands := _commands_that_wrote(folder)):
        message = (
            f"holds results of {' and '.join(commands)}, not a campaign; give the campaign's folder or name"
        )
        raise CampaignError([Problem(str(folder), None, None, None, message)])


def _commands_that_wrote(folder: Path) -> list[str]:
    """The commands whose results a folder holds."""
    return [f"skred {command}" for file, command in _RESULTS.items() if (folder / file).is_file()]


def _covariate_reader(name: str) -> ReadCell:
    """Choose how to read a covariate: by its name alone."""
    return cells.covariate_number if cells.has_unit(name) else cells.covariate_word


def _ids(table: Table, column: str) -> frozenset[str] | None:
    """Return the ids of a table, also of rows with other problems; None where it could not be read."""
    if not table.is_usable:
        return None
    return frozenset(row.word(column) for row in table.rows if row.has(column))


def _releases(table: Table, length_m: float | None) -> dict[str, Row]:
    """Return the rows of events whose release lies on the track, by the events' ids."""
    readable = [row for row in table.rows if row.has("event", "release_s_m")]
    end_m = np.inf if length_m is None else length_m
    return {row.word("event"): row for row in readable if 0.0 <= row.number("release_s_m") <= end_m}


def _track(table: Table, *, may_be_level: bool) -> tuple[Track | None, list[Problem]]:
    """Build the track, or say why there is none."""
    problems = list(table.problems)
    if table.is_usable:
        problems += track_problems(table.rows, may_be_level=may_be_level)
    if problems:
        return None, problems
    columns = {name: np.array([row.number(name) for row in table.rows]) for name in table.columns}
    return Track(columns["x_m"], columns["z_m"], columns.get("width_m")), []


def _sensors(rows: Sequence[Row]) -> tuple[Sensor, ...]:
    """Build the sensors whose cells could all be read and that have a place if they need one."""
    sensors = []
    for row in rows:
        if not row.has(*(column.name for column in SENSORS if column.required)):
            continue
        s_from_m, s_to_m = row.number_or_none("s_from_m"), row.number_or_none("s_to_m")
        is_runout = row.word("quantity") == "runout"
        if not is_runout and (s_from_m is None or s_to_m is None):
            continue
        sensors.append(
            Sensor(
                id=row.word("sensor"),
                quantity=cast(Quantity, row.word("quantity")),
                s_from_m=np.nan if s_from_m is None else s_from_m,
                s_to_m=np.nan if s_to_m is None else s_to_m,
                relative_sd=row.number("relative_sd"),
                absolute_sd=row.number("absolute_sd"),
                place_sd_m=row.number_or_none("place_sd_m"),
            )
        )
    return tuple(sensors)


def _events(table: Table) -> tuple[Event, ...]:
    """Build the events of a table without problems."""
    covariates = [name for name in table.columns if name not in {column.name for column in EVENTS}]
    return tuple(
        Event(
            id=row.word("event"),
            release_s_m=row.number("release_s_m"),
            release_sd_m=row.number_or_none("release_sd_m"),
            covariates={name: row.cells[name] for name in covariates},
            release_speed_m_s=row.number_or_none("release_speed_m_s"),
            release_speed_sd_m_s=row.number_or_none("release_speed_sd_m_s"),
        )
        for row in table.rows
    )


def _too_many(events: Table, sensors: Table) -> list[Problem]:
    """Refuse arrays that would not fit in memory."""
    if len(events.rows) * len(sensors.rows) <= MOST_READINGS:
        return []
    message = f"events times sensors is more than {MOST_READINGS}; split the campaign"
    found = f"{len(events.rows)} events, {len(sensors.rows)} sensors"
    return [Problem(rules.EVENTS, None, None, found, message)]


def _separator_once(problems: Sequence[Problem]) -> list[Problem]:
    """Tell tables that a spreadsheet saved with another separator once: one import reads them all."""
    same = [problem for problem in problems if problem.message == OTHER_SEPARATOR]
    if len(same) < 2:
        return list(problems)
    others = ", ".join(problem.file for problem in same[1:])
    once = replace(same[0], message=f"here and in {others} {OTHER_SEPARATOR}")
    return [once, *(problem for problem in problems if problem not in same)]


def _in_order(problems: Sequence[Problem]) -> list[Problem]:
    """Order the problems by row within each file; the files stay in the order in which they were read."""
    files = list(dict.fromkeys(problem.file for problem in problems))
    return sorted(problems, key=lambda problem: (files.index(problem.file), problem.row or 0))


def _bounded(problems: Sequence[Problem]) -> list[Problem]:
    """Keep so many problems of each file that its owner has enough to do, and say where the list ends."""
    kept: list[Problem] = []
    count: dict[str, int] = {}
    for problem in problems:
        count[problem.file] = count.get(problem.file, 0) + 1
        if count[problem.file] <= MOST_PROBLEMS:
            kept.append(problem)
        elif count[problem.file] == MOST_PROBLEMS + 1:
            message = f"the list ends here, after {MOST_PROBLEMS} problems; correct those above first"
            kept.append(Problem(problem.file, problem.row, None, None, message))
    return kept


def _campaign(
    description: Description,
    track: Track,
    sensors: tuple[Sensor, ...],
    events: tuple[Event, ...],
    rows: Sequence[Row],
) -> Campaign:
    """Put the parts together once nothing is wrong with any of them."""
    shape = (len(events), len(sensors))
    values, stated_sd, values_to = (np.full(shape, np.nan) for _ in range(3))
    status = np.full(shape, Status.MISSING, dtype=np.int8)
    event_index = {event.id: i for i, event in enumerate(events)}
    sensor_index = {sensor.id: j for j, sensor in enumerate(sensors)}
    for row in rows:
        place = event_index[row.word("event")], sensor_index[row.word("sensor")]
        for column, into in (("value", values), ("sd", stated_sd), ("value_to", values_to)):
            number = row.number_or_none(column)
            into[place] = np.nan if number is None else number
        status[place] = Status[row.word("status").upper()]
    return Campaign(
        name=description.name,
        description=description.description,
        source=description.source,
        origin=description.origin,
        reference_s_m=description.reference_s_m,
        track=track,
        sensors=sensors,
        events=events,
        values=values,
        status=status,
        stated_sd=stated_sd,
        values_to=values_to,
    )
