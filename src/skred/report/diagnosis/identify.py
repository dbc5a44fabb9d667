"""What a campaign's recordings can tell, as a table for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skred.report.shared.labels import shortened, unit_text
from skred.report.shared.numbers import decimals_for, rounded, share
from skred.report.shared.tables import plain_table, plain_text

if TYPE_CHECKING:
    from rich.table import Table


def identify_table(document: dict[str, Any]) -> Table:
    """The content of identify.json for the terminal."""
    campaign = document["campaign"]
    name = f"{shortened(campaign['name'], 30)}, {campaign['n_events']} avalanches"
    title = f"{name}: what could be told missing from {document['base_model']}"
    columns = ("unit", "kept", "rele-\nvant", "found\nin", "seen\nfrom", "best\nfrom", "best place,\ns \\[m]")
    table = plain_table(plain_text(title), left=("mechanism",), right=columns)
    table.columns[0].no_wrap = True
    for row in document["identifiability"]:
        numbers = [
            "never" if value is None else rounded(value, decimals_for(value))
            for value in (row["relevant"], row["limit"], row["best_limit"])
        ]
        stretch = row["best_stretch_m"]
        where = "-" if stretch is None else f"{stretch[0]:.0f}-{stretch[1]:.0f}"
        words = (
            row["id"],
            unit_text(row["unit"]),
            share(row["kept"]),
            numbers[0],
            share(row["power"]),
            *numbers[1:],
        )
        table.add_row(*map(plain_text, (*words, where)))
    table.caption = plain_text(
        "Kept: share of the information left after the base law, its scatter and releases. Relevant: the"
        " median size under the prior, found in that share of cases, over all places. Seen from: the strength"
        " found in 90 % of cases at a typical place, and at the best. It depends on track, sensors and"
        " avalanches, not on whether the readings fit."
    )
    table.caption_justify = "left"
    return table
