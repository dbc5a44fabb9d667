"""A prediction beside that of the base law: what hangs on what a diagnosis added."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from skred.report.prediction.words import banded, chance, percent, period
from skred.report.shared import document as doc
from skred.report.shared.numbers import whole

_SHARE = 0.1
"""Of all avalanches, which exceed the speed and the pressure that are compared."""
Row = tuple[str, str, str, str]
"""Place, what, here, and by the base law."""


def comparison_rows(document: doc.Document) -> list[Row]:
    """Rows of the table; none where there is no base law to compare with."""
    base = doc.get(document, "without_added")
    if base is None or doc.get(document, "valid") is not True:
        return []
    pairs = zip(doc.listed(document, "at"), doc.listed(base, "at"), strict=True)
    rows = [row for pair in pairs for row in _at(*pair)]
    runouts = (doc.listed(one, "runout", "exceeded_by") for one in (document, base))
    return [*rows, *(_runout(*pair) for pair in zip(*runouts, strict=True))]


def base_chance(document: doc.Document, number: int) -> str:
    """By the base law, how many come to a place, as a sentence; empty without one."""
    places = doc.listed(doc.get(document, "without_added") or {}, "at")
    if number >= len(places):
        return ""
    share = percent(doc.get(places[number], "reached", "value"))
    return f" By the base law, without what was added, {share} come."


def _at(here: Any, base: Any) -> Iterator[Row]:
    """What is compared at one place."""
    name = str(here["name"])
    yield name, "reached", chance(doc.get(here, "reached")), chance(doc.get(base, "reached"))
    periods = [doc.get(one, "reached", "return_period_years") for one in (here, base)]
    if all(band is not None for band in periods):
        yield name, "return period [years]", period(periods[0]), period(periods[1])
    for key, words in (("speed", "front speed"), ("pressure", "impact pressure")):
        what = f"{words} that 10 % of all exceed [{doc.get(here, key, 'unit')}]"
        yield name, what, banded(_exceeded(here, key)), banded(_exceeded(base, key))


def _exceeded(place: Any, key: str) -> Any:
    rows = doc.listed(place, key, "exceeded_by")
    return next((row for row in rows if row["share"] == _SHARE), None)


def _runout(here: Any, base: Any) -> Row:
    """How far a share of avalanches runs."""
    return "", f"runout s that {100 * here['share']:g} % exceed [m]", _whole(here), _whole(base)


def _whole(row: Any) -> str:
    """A runout with its interval."""
    value = f"{'at least ' if row['at_least'] else ''}{whole(row['value'])}"
    return f"{value} ({whole(row['low'])} to {whole(row['high'])})"
