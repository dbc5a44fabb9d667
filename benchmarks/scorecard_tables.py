"""Tables of a scorecard in Markdown: criteria, what was found, and how right names are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Found = Mapping[str, Any]
STRONG = 5.5
"""Signal-to-noise from which on effects should be found."""


def bars_table(document: Found) -> str:
    """Criteria, and what was measured in one set."""
    rows = [
        "| goal | what | bar | linearised ceiling | measured (95 %) | trials | |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    rows += [f"| {' | '.join([*asked(one), *measured(one)])} |" for one in document["bars"]]
    return "\n".join(rows) + "\n"


def asked(one: Found) -> list[str]:
    """A criterion, its limits, and the linearised ceiling."""
    limit = [f"at least {one['at_least']:g}"] if one["at_least"] is not None else []
    limit += [f"at most {one['at_most']:g}"] if one["at_most"] is not None else []
    ceiling = "" if one["ceiling"] is None else f"{one['ceiling']:.2f}"
    return [one["goal"], one["what"], ", ".join(limit), ceiling]


def measured(one: Found | None) -> list[str]:
    """What was measured, of how many trials, and whether that is enough."""
    if one is None:
        return ["-", "0", ""]
    if one["measured"] is None:
        return ["-", str(one["n"]), one["status"]]
    between = f" ({one['low']:.3g} to {one['high']:.3g})" if one["low"] is not None else ""
    return [f"{one['measured']:.3g}{between}", str(one["n"]), one["status"]]


def found_of(lines: Sequence[Found]) -> str:
    """How many of the strong effects were found."""
    strong = [one["right"] for one in lines if one["true_ids"] and one["snr"] >= STRONG]
    return f"{sum(right not in ('failed', 'not found') for right in strong)} of {len(strong)}"


def named_of(lines: Sequence[Found]) -> list[str]:
    """How many single names are right, and how many ties hold a truth."""
    cells = []
    for several, good in ((False, ("right",)), (True, ("right", "in the set"))):
        named = [one["right"] for one in lines if one["names"] and (len(one["names"]) > 1) == several]
        cells.append(f"{sum(right in good for right in named)} of {len(named)}")
    return cells
