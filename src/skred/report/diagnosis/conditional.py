"""Readings predicted from those above them, before and after something was added: figure and table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skred.report.shared import document as doc
from skred.report.shared.labels import figure_text, name_text, printable, unit_text
from skred.report.shared.numbers import fixed, is_number
from skred.report.shared.recordings import Recordings, recordings_of
from skred.report.shared.style import GREY, MARKERS, PALETTE, legend_below, new_figure, styled, tint

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
_MOST_STYLES = 6
"""Sensors of speed that have a style of their own; more are put together by where they are."""
_WHEN = {"before": "base law", "after": "with what was missing"}
_SETS = {"all": "", "carrying": "those that carry the answer", "others": "the others"}


@dataclass(frozen=True)
class _Style:
    """What readings of some sensors look like."""

    columns: BoolArray
    label: str
    colour: str
    marker: str


def has_conditional(tree: xr.DataTree) -> bool:
    """Whether any reading was predicted from those above it."""
    group = "conditional" in tree.children
    return group and bool((tree["conditional"].to_dataset()["n_above"].values > 0).any())


@styled
def conditional_figure(tree: xr.DataTree) -> Figure:
    """Predicted against recorded, before and after: speeds, and runouts."""
    recordings = recordings_of(tree)
    shown = _values(tree, "before", "n_above") > 0
    runout = recordings.is_runout
    kinds = [kind for kind in (~runout, runout) if shown[:, kind].any()]
    figure = new_figure(3.15, "Each reading, predicted from the readings of the same avalanche above it")
    panels = figure.subplots(1, 2 * len(kinds), squeeze=False)[0]
    for k, kind in enumerate(kinds):
        styles = _styles(recordings, kind & shown.any(axis=0), first=k * _MOST_STYLES)
        _panels(panels[2 * k : 2 * k + 2], tree, recordings, shown & kind, styles)
    legend_below(figure, panels, columns=5)
    return figure


def _panels(
    panels: Sequence[Axes], tree: xr.DataTree, recordings: Recordings, shown: BoolArray, styles: list[_Style]
) -> None:
    """Before and after of speeds or of runouts, on the same axes."""
    runout = bool(recordings.is_runout[styles[0].columns].all())
    zero = (recordings.reference_s_m or 0.0) if runout else 0.0
    what, unit = ("runout", "m") if runout else ("speed", unit_text("m s-1"))
    recorded = recordings.values - zero
    ends = [recorded[shown]]
    for axes, when in zip(panels, _WHEN, strict=True):
        mean, low, high = (_values(tree, when, name) - zero for name in ("mean", "low", "high"))
        ends += [low[shown], high[shown]]
        for style in styles:
            at = shown & style.columns
            axes.vlines(
                recorded[at], low[at], high[at], color=tint(style.colour, 0.4), linewidth=0.8, zorder=1
            )
            axes.plot(
                recorded[at], mean[at], linestyle="none", marker=style.marker, markersize=4.0, zorder=2,
                color=style.colour, markeredgewidth=0.0, label=style.label,
            )  # fmt: skip
        axes.set_title(f"{what}s, {_WHEN[when]}", fontsize=8)
        axes.set_xlabel(f"recorded [{unit}]")
    values = np.concatenate(ends)
    margin = 0.05 * float(np.ptp(values)) or 1.0
    line = [float(values.min() - margin), float(values.max() + margin)]
    beside = 0.08 * float(np.ptp(recorded[shown])) or margin
    for axes in panels:
        axes.plot(
            line, line, color=GREY, linewidth=0.8, linestyle="--", zorder=0, label="predicted = recorded"
        )
        axes.set_xlim(recorded[shown].min() - beside, recorded[shown].max() + beside)
        axes.set_ylim(*line)
    panels[0].set_ylabel(f"predicted {what}{' from the reference' if zero else ''} [{unit}]")
    panels[1].set_yticklabels([])


def _styles(recordings: Recordings, columns: BoolArray, first: int) -> list[_Style]:
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
        styles.append(_Style(chosen, figure_text(label, 24), colour, marker))
    return styles


def _values(tree: xr.DataTree, when: str, name: str) -> FloatArray:
    part = tree["conditional"].to_dataset()[name].sel(when=when)
    return np.asarray(part.transpose("event", "sensor").values, dtype=float)


def conditional_rows(document: doc.Document) -> list[dict[str, str]]:
    """For each sensor, over all avalanches and over parts of them: errors and scores before and after."""
    rows = []
    for entry in doc.listed(document, "conditional", "sensors"):
        decimals = 0 if doc.get(entry, "unit") == "m" else 1
        for key, of in _SETS.items():
            scores = doc.get(entry, key)
            if scores:
                name = printable(doc.get(entry, "sensor")) if key == "all" else ""
                rows.append({"sensor": name, "of": of, **_row(scores, decimals), **_gain(entry, key)})
                rows[-1]["unit"] = unit_text(doc.get(entry, "unit"))
    return rows


def _gain(entry: doc.Document, key: str) -> dict[str, str]:
    return {"gain": name_text(doc.get(entry, "gain") or "") if key == "all" else ""}


def _row(scores: doc.Document, decimals: int) -> dict[str, str]:
    row = {"n": fixed(doc.get(scores, "n"), 0)}
    for name, places in (("rmse", decimals), ("crps", decimals), ("log_score", 2), ("coverage_90", 0)):
        factor = 100.0 if name == "coverage_90" else 1.0
        for when in _WHEN:
            row[f"{name}_{when}"] = fixed(_times(doc.get(scores, f"{name}_{when}"), factor), places)
    for name, places in (("rmse", decimals), ("crps", decimals), ("log_score", 2)):
        change, doubled = (doc.get(scores, f"{name}_{key}") for key in ("diff", "diff_2se"))
        row[f"{name}_change"] = f"{fixed(change, places, signed=True)} ± {fixed(doubled, places)}"
    return row


def _times(value: Any, factor: float) -> float | None:
    return factor * value if is_number(value) else None
