"""A prediction as a table for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skred.report.prediction.words import percent, period_and_interval
from skred.report.shared.labels import printable, shortened
from skred.report.shared.numbers import three_digits, whole

if TYPE_CHECKING:
    from rich.table import Table


def prediction_table(document: dict[str, Any]) -> Table:
    """How far and how fast, with bands, for the terminal.

    Parameters
    ----------
    document : dict
        The content of ``prediction.json``.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    name = shortened(document["track"]["name"], 60)
    title = Text(f"{name}: the next avalanche, {printable(document['law']['title'])}")
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1))
    table.add_column("predicted", overflow="fold")
    for column in ("", "90 % band", "unit"):
        table.add_column(column, justify="right", no_wrap=True)
    if not document["valid"]:
        table.add_row(Text("nothing: the chains did not converge", style="red"), "", "", "")
        return table
    for row in document["runout"]["exceeded_by"]:
        what = f"runout exceeded by {100 * row['share']:g} %"
        bound = "≥ " if row["at_least"] else ""
        table.add_row(what, bound + whole(row["value"]), f"{whole(row['low'])} to {whole(row['high'])}", "m")
    for row in document["runout"].get("once_in", ()):
        table.add_row(f"runout reached once in {row['years']:g} years", *_once_in(row), "m")
    for place in document["at"]:
        _place_rows(table, place)
    return table


def _place_rows(table: Table, place: dict[str, Any]) -> None:
    """Arrival, thresholds, and what a tenth of all avalanches exceed, at one place."""
    from rich.text import Text

    where = f"{shortened(place['name'], 20)} (s = {place['s_m']:.0f} m)"
    table.add_row(Text(f"{where}: reached"), *_chance(place["reached"]), "-")
    for name, words in (("speed", "speed"), ("pressure", "impact pressure")):
        unit = place[name]["unit"]
        for row in place[name]["above"]:
            what = f"{where}: {words} above {row['threshold']:g} {unit}"
            table.add_row(Text(what), *_chance(row), "-")
        tenth = next(row for row in place[name]["exceeded_by"] if row["share"] == 0.1)
        value, low, high = (three_digits(tenth[key]) for key in ("value", "low", "high"))
        table.add_row(Text(f"{where}: {words} exceeded by 10 % of all"), value, f"{low} to {high}", unit)
        coming = [row for row in place[name]["given_reached"] if row["share"] == 0.1]
        for row in coming:
            value, low, high = (three_digits(row[key]) for key in ("value", "low", "high"))
            what = f"{where}: {words} exceeded by 10 % of those that come"
            table.add_row(Text(what), value, f"{low} to {high}", unit)
    period = place["reached"].get("return_period_years")
    if period is not None:
        table.add_row(Text(f"{where}: return period of arrival"), *period_and_interval(period), "years")


def _chance(band: dict[str, float]) -> tuple[str, str]:
    return percent(band["value"]), f"{percent(band['low'])} to {percent(band['high'])}"


def _once_in(row: dict[str, Any]) -> tuple[str, str]:
    """The runout for a return period, and its interval: a dash where fewer than one avalanche starts."""
    value, low, high = ("-" if row[key] is None else whole(row[key]) for key in ("value", "low", "high"))
    if row["high"] is None:
        return value, "-"
    bound = "≥ " if row["at_least"] else ""
    return bound + value, f"at most {high}" if row["low"] is None else f"{low} to {high}"
