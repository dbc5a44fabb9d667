"""Figures of a hierarchical comparison: beside the pooled one, and new avalanches under each law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.report.comparing import law_axis, styles, typeset
from skred.report.document import (
    PRACTICAL_DIFFERENCE,
    Document,
    get,
    is_hierarchical,
    listed,
    passed,
    ranked,
    side_by_side,
)
from skred.report.draws import MAX_SENSORS
from skred.report.labels import figure_text, unit_text
from skred.report.numbers import floats, is_number
from skred.report.style import GREY, PALE, RECORDED, legend_below, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_APART = 0.17


@styled
def likelihoods_figure(comparison: Document) -> Figure | None:
    """Differences of elpd to the best law, of the hierarchical and of the pooled calibration."""
    rows = [row for row in side_by_side(comparison) if _difference(row["hierarchical"]) is not None]
    both = [row for row in rows if _difference(row["pooled"]) is not None]
    if not is_hierarchical(comparison) or not both:
        return None
    figure = new_figure(1.75 + 0.45 * len(rows), "The same laws under both calibrations")
    axes = figure.subplots()
    label = f"no practical difference: less than {PRACTICAL_DIFFERENCE:.0f}"
    axes.axvspan(-PRACTICAL_DIFFERENCE, PRACTICAL_DIFFERENCE, color=PALE, alpha=0.7, linewidth=0, label=label)
    axes.axvline(0, color=GREY, linewidth=0.8)
    colours, _ = styles(comparison)
    for place, row in enumerate(rows):
        for key, offset in (("hierarchical", -_APART), ("pooled", _APART)):
            _difference_row(axes, row[key], place + offset, colours[row["id"]], hollow=key == "pooled")
    for name, face in (("every avalanche its own friction", GREY), ("pooled", "#ffffff")):
        axes.plot(
            [], [], marker="o", linestyle="none", color=GREY, markerfacecolor=face, markersize=6, label=name
        )
    axes.plot([], [], color=GREY, linewidth=1.2, label="doubled standard error")
    law_axis(axes, rows)
    axes.set_ylim(len(rows) - 0.5, -0.7)
    axes.set_xlabel("difference of elpd (leave-one-event-out) to the best law of the same calibration [nats]")
    legend_below(figure, [axes], columns=4)
    return figure


def _difference(model: Document | None) -> float | None:
    """Difference of elpd of a law that passed the gate."""
    value = get(model, "difference", "elpd")
    return float(value) if model is not None and passed(model) and is_number(value) else None


def _difference_row(axes: Axes, model: Document | None, y: float, colour: str, *, hollow: bool) -> None:
    difference = _difference(model)
    if difference is None:
        return
    doubled = 2 * float(np.nan_to_num(floats([get(model, "difference", "se")]))[0])
    axes.hlines(y, difference - doubled, difference + doubled, color=colour, linewidth=1.2)
    face = "#ffffff" if hollow else colour
    axes.plot(difference, y, marker="o", color=colour, markerfacecolor=face, markersize=6)
    end = (difference + doubled, y)
    axes.annotate(typeset(difference), end, (7, 0), textcoords="offset points", va="center", fontsize=7)


@styled
def new_avalanches_figure(comparison: Document) -> Figure | None:
    """Interval of a new avalanche's reading at each sensor under each law, against the recorded ones."""
    laws = [law for law in ranked(comparison) if listed(law, "new_avalanche")]
    if not laws:
        return None
    sensors = [(entry["sensor"], entry["unit"]) for entry in listed(laws[0], "new_avalanche")]
    shown = sensors[:MAX_SENSORS]
    columns = 1 if len(shown) == 1 else 2 if len(shown) <= 4 else 3
    rows = -(-len(shown) // columns)
    more = f" (the first {MAX_SENSORS} of {len(sensors)} sensors)" if len(shown) < len(sensors) else ""
    title = f"A new avalanche under each law against the recorded ones{more}"
    title += "\nin percent: how many new avalanches get there, and how many recorded ones did"
    figure = new_figure(1.2 + rows * (0.95 + 0.26 * len(laws)), title)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes, (sensor, unit) in zip(panels, shown, strict=False):
        _new_avalanches(axes, comparison, laws, sensor, unit)
    for axes in panels[len(shown) :]:
        axes.remove()
    legend_below(figure, panels[: len(shown)], columns=2)
    return figure


def _new_avalanches(axes: Axes, comparison: Document, laws: list[Document], sensor: str, unit: str) -> None:
    colours, markers = styles(comparison)
    reference = get(comparison, "campaign", "reference_s_m")
    from_reference = unit == "m" and is_number(reference)
    offset = float(reference) if from_reference else 0.0
    percent = f"{100 * (get(comparison, 'interval', 'probability') or 0.9):.0f} % interval"
    for row, law in enumerate(laws):
        found = [entry for entry in listed(law, "new_avalanche") if entry["sensor"] == sensor]
        entry = found[0] if found else {}
        low, mean, high = floats([get(entry, key) for key in ("low", "mean", "high")]) - offset
        axes.hlines(row, low, high, color=colours[law["id"]], linewidth=2.2)
        axes.plot(mean, row, marker=markers[law["id"]], color=colours[law["id"]], markersize=5)
        if unit != "m" and is_number(get(entry, "reached")):
            _beside(axes, row, f"{100 * entry['reached']:.0f} %")
        if row == 0:
            _recorded(axes, entry, offset, percent, len(laws))
            if unit != "m" and is_number(get(entry, "recorded_reached")):
                _beside(axes, len(laws), f"{100 * entry['recorded_reached']:.0f} %")
    axes.plot([], [], color=GREY, linewidth=2.2, label=f"new avalanche that gets there, mean and {percent}")
    law_axis(axes, [*laws, {"id": "recorded"}])
    axes.locator_params(axis="x", nbins=6)
    axes.set_title(figure_text(sensor, 30))
    quantity = "relative to the reference " if from_reference else ""
    axes.set_xlabel(f"{quantity}[{figure_text(unit_text(unit), 20)}]")


def _recorded(axes: Axes, entry: Document, offset: float, percent: str, row: int) -> None:
    low, mean, high = (
        floats([get(entry, f"recorded_{key}") for key in ("low", "mean", "high")]) - offset
    )  # fmt: skip
    if not np.isfinite(mean):
        return
    axes.axvspan(low, high, color=GREY, alpha=0.14, linewidth=0)
    axes.hlines(row, low, high, color=RECORDED, linewidth=2.2)
    axes.plot(mean, row, marker="D", color=RECORDED, markersize=4.5, linestyle="none")
    axes.plot([], [], color=RECORDED, linewidth=2.2, label=f"recorded, mean and {percent}")


def _beside(axes: Axes, row: int, text: str) -> None:
    """A share at the right end of a row."""
    axes.text(1.01, row, text, transform=axes.get_yaxis_transform(), va="center", ha="left", fontsize=7.5)
