"""The table of the named places: one row a number, for a spreadsheet."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from typing import Any

BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"
"""At the start of the file: by it Excel knows the text as UTF-8."""
COLUMNS = ("place", "s [m]", "what", "threshold", "unit", "value", "low (90 %)", "high (90 %)")
_ENDS = ("value", "low", "high")
_FORMULA = re.compile(r"(^|[;\t\r\n])(?=\s*[=+\-@\N{FULLWIDTH EQUALS SIGN}\N{FULLWIDTH PLUS SIGN}])")
"""Where a spreadsheet would see a formula: at the start, and after what ends a cell in some countries."""
Row = tuple[str, str, str, dict[str, Any]]
"""What, threshold, unit, and a value with its band."""


def places_table(document: dict[str, Any]) -> str:
    """The table as CSV with commas, a dot as decimal sign, and lines ended as spreadsheets expect.

    Parameters
    ----------
    document : dict
        The content of ``prediction.json``.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for place in document["at"]:
        for what, threshold, unit, band in _rows(place):
            numbers = (_number(band[key]) for key in _ENDS)
            writer.writerow([_text(place["name"]), f"{place['s_m']:.1f}", what, threshold, unit, *numbers])
    return text.getvalue()


def _rows(place: dict[str, Any]) -> Iterator[Row]:
    """What, threshold, unit and band of each row of a place."""
    yield from _chances("avalanche comes", "", place["reached"])
    for name, words in (("speed", "front speed"), ("pressure", "impact pressure")):
        quantity = place[name]
        unit = quantity["unit"]
        for row in quantity["given_reached"]:
            share = f"{100 * row['share']:g} %"
            yield f"{words} that {share} of avalanches that come exceed", "", unit, row
        for row in quantity["exceeded_by"]:
            share = f"{100 * row['share']:g} %"
            yield f"{words} that {share} of all avalanches exceed", "", unit, row
        for row in quantity["above"]:
            yield from _chances(f"{words} above", f"{row['threshold']:g} {unit}", row)


def _chances(what: str, threshold: str, row: dict[str, Any]) -> Iterator[Row]:
    yield f"{what}: probability for an avalanche", threshold, "1", row
    if "annual" in row:
        yield f"{what}: probability in a year", threshold, "1", row["annual"]
        yield f"{what}: return period", threshold, "years", row["return_period_years"]


def _text(name: str) -> str:
    """A name that a spreadsheet takes as text: an apostrophe where it would see a formula.

    Names of sensors come with campaigns of others, and what is computed may read files or call other hosts.
    """
    return _FORMULA.sub(r"\1'", name)


def _number(value: float | None) -> str:
    """Five significant digits, more than the simulation supports; empty where there is none."""
    return "" if value is None else f"{value:.5g}"
