"""Readings predicted from those above them, before and after something was added: figure and table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.report.shared import document as doc
from skred.report.shared.labels import figure_text, name_text, printable, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, is_number
from skred.report.shared.recordings import Recordings, recordings_of
from skred.report.shared.style import (
    GREY,
    MARKERS,
    PALETTE,
    RECORDED,
    WIDTH,
    legend_below,
    new_figure,
    styled,
    tint,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_STYLES = 6
"""Sensors of speed that have a style of their own; more are put together by where they are."""
_FARTHEST = 0.25
"""How far beyond the recordings a prediction is shown where it is, in their range."""
_WHEN = ("before", "after")
_PARTS = {"carrying": "those that carry the answer", "others": "the others"}


@dataclass(frozen=True)
class Style:
    """What readings of some sensors look like."""

    columns: BoolArray
    label: str
    colour: str
    marker: str


def conditional_kinds(tree: xr.DataTree) -> list[str]:
    """Of speeds and runouts, which were predicted from readings above them."""
    if "conditional" not in tree.children:
        return []
    runout, shown = recordings_of(tree).is_runout, _values(tree, "before", "n_above") > 0
    of_kind = {"speeds": shown[:, ~runout], "runouts": shown[:, runout]}
    return [kind for kind, one in of_kind.items() if one.any()]


@styled
def conditional_figure(document: doc.Document, tree: xr.DataTree, kind: str) -> Figure:
    """Predicted against recorded, before and after: ``speeds`` or ``runouts``.

    They stand side by side on a wide screen, and on a narrow one below each other.
    """
    recordings, runout = recordings_of(tree), kind == "runouts"
    shown = (_values(tree, "before", "n_above") > 0) & (recordings.is_runout == runout)
    styles = styles_of(recordings, shown.any(axis=0), first=_MOST_STYLES if runout else 0)
    carrying = np.isin(recordings.event_ids, doc.get(document, "influence", "carried_by") or [])
    given = "all speeds" if runout else "those above it"
    figure = new_figure(3.3, f"{kind.capitalize()}, each predicted from {given}", width=0.5 * WIDTH)
    panels = figure.subplots(1, 2, sharey=True)
    _panels(panels, tree, recordings, shown, styles)
    _mark(panels, tree, recordings, shown & carrying[:, None])
    legend_below(figure, panels, columns=3)
    return figure


def _panels(
    panels: Sequence[Axes], tree: xr.DataTree, recordings: Recordings, shown: BoolArray, styles: list[Style]
) -> None:
    """Before and after of speeds or of runouts, on the same axes."""
    runout, zero = _scale(recordings, shown)
    what, unit = ("runout", "m") if runout else ("speed", unit_text("m s-1"))
    recorded = recordings.values - zero
    x = recorded[shown]
    size = float(np.ptp(x)) or 1.0
    bands = {when: [_values(tree, when, name) - zero for name in ("mean", "low", "high")] for when in _WHEN}
    every = np.concatenate([x, *(values[shown] for band in bands.values() for values in band)])
    # One prediction that is far off must not press all others into a line: it stands at the edge, open.
    least, most = max(every.min(), x.min() - _FARTHEST * size), min(every.max(), x.max() + _FARTHEST * size)
    line = least - 0.05 * (most - least), most + 0.05 * (most - least)
    for axes, (when, (mean, low, high)) in zip(panels, bands.items(), strict=True):
        axes.plot(
            line, line, color=GREY, linewidth=0.8, linestyle="--", zorder=0, label="predicted = recorded"
        )
        for style in styles:
            at = shown & style.columns
            ends = np.clip(low[at], *line), np.clip(high[at], *line)
            axes.vlines(recorded[at], *ends, color=tint(style.colour, 0.4), linewidth=0.8, zorder=1)
            inside = (mean[at] >= least) & (mean[at] <= most)
            points: dict[str, Any] = {
                "linestyle": "none",
                "marker": style.marker,
                "color": style.colour,
                "markersize": 4.0,
            }
            axes.plot(
                recorded[at][inside], mean[at][inside], label=style.label, markeredgewidth=0.0, **points
            )
            outside = recorded[at][~inside], np.clip(mean[at][~inside], least, most)
            axes.plot(*outside, markerfacecolor="none", markeredgewidth=0.8, **points)
            told = [mean[at], low[at], high[at]]
            _tell(axes, recordings, at, recorded[at], np.clip(mean[at], least, most), told, unit)
        axes.set_title(when, fontsize=8.5)
        axes.set_xlabel(f"recorded {what} [{unit}]")
        axes.set_xlim(x.min() - 0.08 * size, x.max() + 0.08 * size)
        axes.set_ylim(*line)
    panels[0].set_ylabel(f"predicted {what} [{unit}]")


def _tell(
    axes: Axes, recordings: Recordings, at: BoolArray, x: FloatArray, y: FloatArray,
    predicted: list[FloatArray], unit: str,
) -> None:  # fmt: skip
    """Say of each point which avalanche and sensor it is, what was recorded and what predicted."""
    places = np.argwhere(at)
    events = [recordings.event_ids[event] for event, _ in places]
    names = [f"{recordings.event_ids[event]}, {recordings.sensors[column].id}" for event, column in places]
    decimals = 0 if unit == "m" else 1
    words = [
        f"{name}\nrecorded {fixed(value, decimals)} {unit}\npredicted {fixed(mean, decimals)}"
        f" (90 %: {fixed(low, decimals)} to {fixed(high, decimals)})"
        for name, value, mean, low, high in zip(
            names, x.tolist(), *(part.tolist() for part in predicted), strict=True
        )
    ]
    mark(axes, x, y, words, events)


def _mark(panels: Sequence[Axes], tree: xr.DataTree, recordings: Recordings, carrying: BoolArray) -> None:
    """A ring around the readings of avalanches that carry the answer."""
    _, zero = _scale(recordings, carrying)
    for axes, when in zip(panels, _WHEN, strict=True) if carrying.any() else ():
        least, most = axes.get_ylim()
        inset = 0.05 / 1.1 * (most - least)
        y = np.clip(_values(tree, when, "mean")[carrying] - zero, least + inset, most - inset)
        axes.plot(
            recordings.values[carrying] - zero, y, linestyle="none", marker="o", color=RECORDED,
            markersize=7.5, markerfacecolor="none", markeredgewidth=0.9, label="carries the answer",
        )  # fmt: skip


def _scale(recordings: Recordings, shown: BoolArray) -> tuple[bool, float]:
    """Whether these readings are runouts, and where they are counted from."""
    runout = bool(recordings.is_runout[shown.any(axis=0)].all())
    return runout, (recordings.reference_s_m or 0.0) if runout else 0.0


def styles_of(recordings: Recordings, columns: BoolArray, first: int) -> list[Style]:
    """A colour and a marker for each sensor, or for each of six stretches of the track."""
    numbers = np.flatnonzero(columns)
    parts = [[k] for k in numbers]
    if len(numbers) > _MOST_STYLES:
        at = [0.5 * (recordings.sensors[k].s_from_m + recordings.sensors[k].s_to_m) for k in numbers]
        ordered = numbers[np.argsort(at)]
        parts = [list(part) for part in np.array_split(ordered, _MOST_STYLES)]
    styles = []
    for k, part in enumerate(parts):
        sensors = [recordings.sensors[j] for j in part]
        label = sensors[0].id
        if len(sensors) > 1:
            label = f"s = {sensors[0].s_from_m:.0f} to {sensors[-1].s_to_m:.0f} m"
        chosen = np.isin(np.arange(len(columns)), part)
        colour, marker = PALETTE[(first + k) % len(PALETTE)], MARKERS[(first + k) % len(MARKERS)]
        styles.append(Style(chosen, figure_text(label, 24), colour, marker))
    return styles


def _values(tree: xr.DataTree, when: str, name: str) -> FloatArray:
    part = tree["conditional"].to_dataset()[name].sel(when=when)
    return np.asarray(part.transpose("event", "sensor").values, dtype=float)


def conditional_rows(document: doc.Document) -> list[dict[str, str]]:
    """For each sensor, over all avalanches and over parts of them: errors and scores before and after."""
    rows = []
    entries = doc.listed(document, "conditional", "sensors")
    speeds = doc.get(document, "conditional", "speeds")
    if speeds and sum(doc.get(entry, "quantity") != "runout" for entry in entries) > 1:
        entries = [*entries, {"sensor": "all speeds", "unit": "m s-1", **speeds}]
    for entry in entries:
        unit = unit_text(doc.get(entry, "unit"))
        decimals = 0 if unit == "m" else 1
        words = {"all": f"{printable(doc.get(entry, 'sensor'))} [{unit}]", **_PARTS}
        gains = {"all": name_text(doc.get(entry, "gain") or "")}
        carried = bool(doc.get(entry, "carrying"))
        for key, name in words.items():
            scores = doc.get(entry, key)
            if scores and (carried or key == "all"):
                rows.append({"name": name, "gain": gains.get(key, ""), **_row(scores, decimals)})
    return rows


def _row(scores: doc.Document, decimals: int) -> dict[str, str]:
    return {
        "n": fixed(doc.get(scores, "n"), 0),
        "error": _pair(scores, "rmse", decimals),
        "error_change": _change(scores, "rmse", decimals),
        "crps": _pair(scores, "crps", decimals),
        "crps_change": _change(scores, "crps", decimals),
        "log_score": _pair(scores, "log_score", 2),
        "log_score_change": _change(scores, "log_score", 2),
        "inside": _pair(scores, "coverage_90", 0, 100.0),
    }


def _pair(scores: doc.Document, name: str, decimals: int, factor: float = 1.0) -> str:
    values = [doc.get(scores, f"{name}_{when}") for when in _WHEN]
    return " → ".join(fixed(factor * one if is_number(one) else None, decimals) for one in values)


def _change(scores: doc.Document, name: str, decimals: int) -> str:
    change, doubled = (doc.get(scores, f"{name}_{key}") for key in ("diff", "diff_2se"))
    return f"{fixed(change, decimals, signed=True)} ± {fixed(doubled, decimals)}"
