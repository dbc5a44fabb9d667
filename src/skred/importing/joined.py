"""Several wide tables as one: the same avalanches with other columns, or others with the same columns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from skred.campaign import Problem
from skred.importing.draft import DraftTable, Where
from skred.importing.readings import MISSING

Row = tuple[Where, dict[str, str]]


def joined(
    tables: Sequence[Mapping[str, DraftTable]], release_s_m: float | None, problems: list[Problem]
) -> dict[str, DraftTable]:
    """Join tables as the format has them, read from wide ones.

    Parameters
    ----------
    tables : sequence of mapping
        ``sensors``, ``events`` and ``recordings`` of each.
    release_s_m : float or None
        Where avalanches start of which no table says so, arc length, m.
    problems : list of Problem
        What the tables say differently of one thing is added.
    """
    if len(tables) == 1:
        return dict(tables[0])
    sensors = _joined([table["sensors"] for table in tables], ("sensor",), _first_or_problem, problems)
    events = _joined([table["events"] for table in tables], ("event",), _merged, problems)
    recordings = _joined([table["recordings"] for table in tables], ("event", "sensor"), _said_once, problems)
    for where, row in events.rows:
        if not row.get("release_s_m"):
            row["release_s_m"] = "" if release_s_m is None else repr(release_s_m)
            if release_s_m is None:
                message = (
                    f"'{row['event']}' is in no table with releases; add it there, or say with "
                    "--set release.s_m=S where such avalanches start"
                )
                problems.append(Problem(where.file, where.line, where.columns["event"], None, message))
    return {"sensors": sensors, "events": events, "recordings": recordings}


Join = Callable[[Row, Row, list[Problem]], Row]


def _joined(
    tables: Sequence[DraftTable], key: tuple[str, ...], join: Join, problems: list[Problem]
) -> DraftTable:
    """Rows of all tables; those of the same key in different tables become one."""
    columns = list(dict.fromkeys(column for table in tables for column in table.columns))
    if "status" in columns:  # as a single table has them
        columns.sort(key=("event", "sensor", "value", "value_to", "sd", "status").index)
    rows = list[Row]()
    position = dict[tuple[str, ...], int]()
    for table in tables:
        own = dict[tuple[str, ...], int]()
        for where, row in table.rows:
            name = tuple(row[column] for column in key)
            if name in position:
                rows[position[name]] = join(rows[position[name]], (where, row), problems)
            else:
                # A key that stands twice in one table stays so: the check of the draft refuses it.
                own.setdefault(name, len(rows))
                rows.append((where, row))
        position |= own
    return DraftTable(tuple(columns), tuple(rows))


def _differs(first: Row, second: Row, column: str, problems: list[Problem]) -> None:
    """Keep that two tables say different things."""
    (there, one), (where, other) = first, second
    there = there.of(column)
    message = f"{there.file}, row {there.line} says '{one[column]}'; correct one of the two"
    problems.append(
        Problem(where.file, where.line, where.columns.get(column, column), other[column], message)
    )


def _first_or_problem(first: Row, second: Row, problems: list[Problem]) -> Row:
    """A sensor that two tables know, alike."""
    for column, value in second[1].items():
        if value != first[1].get(column, ""):
            _differs(first, second, column, problems)
    return first


def _merged(first: Row, second: Row, problems: list[Problem]) -> Row:
    """An avalanche with what each table says of it."""
    (where, row), (other, more) = first, second
    merged, others = dict(row), dict(where.others)
    for column, value in more.items():
        if not merged.get(column):
            merged[column] = value
            others[column] = other
        elif value and not _same(value, merged[column]):
            _differs(first, second, column, problems)
    return replace(where, others=others), merged


def _said_once(first: Row, second: Row, problems: list[Problem]) -> Row:
    """A reading that one of two tables holds, or both alike."""
    if first[1].get("status") == MISSING:
        return second
    said = ("status", "value", "value_to", "sd")
    if second[1].get("status") == MISSING:
        return first
    for column in said:
        if not _same(first[1].get(column, ""), second[1].get(column, "")):
            _differs(first, second, column, problems)
            break
    return first


def _same(one: str, other: str) -> bool:
    """Whether two texts are the same word or number."""
    try:
        return float(one) == float(other)
    except ValueError:
        return one == other
