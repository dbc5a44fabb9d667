"""Tables of the avalanches themselves: what each says of the answer, each reading beside its predictions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skred.report.shared import document as doc
from skred.report.shared.labels import printable, unit_text
from skred.report.shared.numbers import fixed, share
from skred.report.shared.recordings import recordings_of

if TYPE_CHECKING:
    import xarray as xr

Rows = list[dict[str, Any]]
Bands = dict[str, NDArray[np.float64]]
_WHEN, _BAND = ("before", "after"), ("mean", "low", "high")
MOST_ROWS = 3000
"""Readings that a page lists."""
_FEW_DRAWS = 100.0
"""Effective draws below which a prediction is rough."""
MOST_OPEN = 120
"""Readings of a table that is open when the page opens."""


def event_rows(document: doc.Document, tree: xr.DataTree) -> Rows:
    """One row an avalanche: the evidence without it, its log score before and after; empty without both."""
    without = {
        printable(doc.get(one, "event")): doc.get(one, "log_bayes_factor")
        for one in doc.listed(document, "influence", "events")
    }
    scores: dict[str, dict[str, float]] = {}
    if "held_out" in tree.children:
        held = tree["held_out"].to_dataset()
        for when in map(str, held["when"].values):
            values = held["log_score"].sel(when=when).values.tolist()
            scores[when] = dict(zip(map(printable, held["event"].values), values, strict=True))
    carried = set(map(printable, doc.listed(document, "influence", "carried_by")))
    own = {printable(doc.get(one, "event")): one for one in doc.listed(document, "strength", "events")}
    names = list(dict.fromkeys([*scores.get("before", {}), *without]))
    rows = []
    for name in names:
        before, after = (scores.get(when, {}).get(name) for when in _WHEN)
        change = after - before if after is not None and before is not None else None
        rows.append(
            {
                "event": name,
                "carries": "yes" if name in carried else "",
                "own": _own(own.get(name)),
                "without": fixed(without.get(name), 1),
                "before": fixed(before, 1),
                "after": fixed(after, 1),
                "change": fixed(change, 1, signed=True),
            }
        )
    return rows


def _own(found: doc.Document | None) -> str:
    """How probably an avalanche has what was added, or how many times the median of it."""
    if found is None:
        return ""
    probability, multiple = (doc.get(found, key) for key in ("probability", "multiple"))
    return fixed(multiple, 1) if probability is None else share(probability)


def reading_rows(tree: xr.DataTree) -> Rows:
    """One row a reading that was predicted from the other avalanches, and from the readings above it.

    None with more readings than a page holds: they are in ``diagnosis.nc``.
    """
    if "held_out" not in tree.children:
        return []
    recordings = recordings_of(tree)
    if recordings.observed.sum() > MOST_ROWS:
        return []
    others, above = _predictions(tree, "held_out"), _predictions(tree, "conditional")
    rows = []
    for event, column in np.argwhere(recordings.observed).tolist():
        sensor = recordings.sensors[column]
        zero = (recordings.reference_s_m or 0.0) if sensor.is_runout else 0.0
        decimals = 0 if sensor.is_runout else 1
        at = (event, column, zero, decimals)
        rows.append(
            {
                "event": printable(recordings.event_ids[event]),
                "sensor": printable(sensor.id),
                "unit": unit_text("m" if sensor.is_runout else "m s-1"),
                "recorded": fixed(float(recordings.values[event, column] - zero), decimals),
                "others": [_band(others.get(when), *at) for when in _WHEN],
                "above": [_band(above.get(when), *at) for when in _WHEN],
            }
        )
    return rows


def _predictions(tree: xr.DataTree, group: str) -> dict[str, Bands]:
    """Predictions of a group before and after, each (event, sensor); empty where there is none."""
    if group not in tree.children:
        return {}
    found = tree[group].to_dataset().load().transpose(..., "event", "sensor")
    names = [name for name in (*_BAND, "n_above", "effective") if name in found]
    return {
        str(when): {name: np.asarray(found[name].sel(when=when).values, dtype=float) for name in names}
        for when in found["when"].values
    }


def _band(found: Bands | None, event: int, column: int, zero: float, decimals: int) -> str:
    """Mean and 90 % interval of a prediction, a star where few draws make it; a dash where there is none."""
    if found is None or ("n_above" in found and found["n_above"][event, column] == 0):
        return "-"
    mean, low, high = (fixed(float(found[name][event, column]) - zero, decimals) for name in _BAND)
    few = "effective" in found and found["effective"][event, column] < _FEW_DRAWS
    return f"{mean} ({low} to {high}){'*' if few else ''}"
