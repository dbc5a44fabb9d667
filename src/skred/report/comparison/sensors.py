"""Figures that set laws side by side at each sensor: mean responses, and new avalanches."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from skred.report.comparison.parts import law_axis, styles
from skred.report.shared.document import Document, get, listed, ranked
from skred.report.shared.draws import MAX_SENSORS, left_out
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats, is_number
from skred.report.shared.style import GREY, RECORDED, grid_for, legend_below, new_figure, panels_in, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def predictions_figure(comparison: Document) -> Figure | None:
    """Interval of each law's mean response at each sensor, against the recorded mean."""

    def height(rows: int, laws: int) -> float:
        return 0.9 + rows * (0.75 + 0.24 * laws)

    title = "Mean response of each law against the recorded mean{left_out}"
    return _at_sensors(comparison, "response", title, height, _responses, legend_columns=3)


@styled
def new_avalanches_figure(comparison: Document) -> Figure | None:
    """Interval of a new avalanche's reading at each sensor under each law, against the recorded ones."""

    def height(rows: int, laws: int) -> float:
        return 1.2 + rows * (0.95 + 0.26 * laws)

    title = "A new avalanche under each law against the recorded ones{left_out}"
    title += "\nin percent: how many new avalanches get there, and how many recorded ones did"
    return _at_sensors(comparison, "new_avalanche", title, height, _new_avalanches, legend_columns=2)


def _at_sensors(
    comparison: Document,
    key: str,
    title: str,
    height: Callable[[int, int], float],
    draw: Callable[[Axes, Document, list[Document], str, str], None],
    *,
    legend_columns: int,
) -> Figure | None:
    """One panel for each sensor of the laws' list `key`; height from the numbers of rows and of laws."""
    laws = [law for law in ranked(comparison) if listed(law, key)]
    if not laws:
        return None
    sensors = [(entry["sensor"], entry["unit"]) for entry in listed(laws[0], key)]
    shown = sensors[:MAX_SENSORS]
    rows, columns = grid_for(len(shown))
    figure = new_figure(height(rows, len(laws)), title.format(left_out=left_out(len(sensors))))
    panels = panels_in(figure, len(shown), columns, sharey=True)
    for axes, (sensor, unit) in zip(panels, shown, strict=True):
        draw(axes, comparison, laws, sensor, unit)
    legend_below(figure, panels, columns=legend_columns)
    return figure


def _entry_at(law: Document, key: str, sensor: str) -> Document:
    """What a law's list `key` says of a sensor; empty where it says nothing."""
    return next((entry for entry in listed(law, key) if entry["sensor"] == sensor), {})


def _reference(comparison: Document, unit: str) -> float | None:
    """Place that runouts are drawn from; None for speeds, and where there is no such place."""
    reference = get(comparison, "campaign", "reference_s_m")
    return float(reference) if unit == "m" and is_number(reference) else None


def _percent(comparison: Document) -> str:
    return f"{100 * (get(comparison, 'interval', 'probability') or 0.9):.0f} % interval"


def _label_sensor(axes: Axes, sensor: str, unit: str, reference: float | None) -> None:
    axes.locator_params(axis="x", nbins=6)
    axes.set_title(figure_text(sensor, 30))
    quantity = "" if reference is None else "relative to the reference "
    axes.set_xlabel(f"{quantity}[{figure_text(unit_text(unit), 20)}]")


def _responses(axes: Axes, comparison: Document, laws: list[Document], sensor: str, unit: str) -> None:
    colours, markers = styles(comparison)
    reference = _reference(comparison, unit)
    offset = reference or 0.0
    keys = ("mean", "low", "high", "recorded_mean", "recorded_se")
    for row, law in enumerate(laws):
        entry = _entry_at(law, "response", sensor)
        mean, low, high, recorded, se = floats([get(entry, key) for key in keys])
        if row == 0 and np.isfinite(recorded):
            axes.axvline(recorded - offset, color=RECORDED, linewidth=1.2, label="recorded mean")
            if np.isfinite(se):
                left, right = recorded - se - offset, recorded + se - offset
                axes.axvspan(left, right, color=GREY, alpha=0.25, linewidth=0, label="its standard error")
        colour = colours[law["id"]]
        axes.hlines(row, low - offset, high - offset, color=colour, linewidth=2.2)
        axes.plot(mean - offset, row, marker=markers[law["id"]], color=colour, markersize=5)
        interval = f"{fixed(low - offset, 1)} to {fixed(high - offset, 1)}"
        told = f"{law['id']}, {sensor}: mean response {fixed(mean - offset, 1)} ({interval})"
        mark(axes, mean - offset, row, [f"{told}; recorded mean {fixed(recorded - offset, 1)}"])
    axes.plot([], [], color=GREY, linewidth=2.2, label=f"mean response, {_percent(comparison)}")
    law_axis(axes, laws)
    _label_sensor(axes, sensor, unit, reference)


def _new_avalanches(axes: Axes, comparison: Document, laws: list[Document], sensor: str, unit: str) -> None:
    colours, markers = styles(comparison)
    reference, percent = _reference(comparison, unit), _percent(comparison)
    offset = reference or 0.0
    for row, law in enumerate(laws):
        entry = _entry_at(law, "new_avalanche", sensor)
        low, mean, high = floats([get(entry, key) for key in ("low", "mean", "high")]) - offset
        axes.hlines(row, low, high, color=colours[law["id"]], linewidth=2.2)
        axes.plot(mean, row, marker=markers[law["id"]], color=colours[law["id"]], markersize=5)
        told = f"{law['id']}, {sensor}: mean {fixed(mean, 1)} ({fixed(low, 1)} to {fixed(high, 1)})"
        mark(axes, mean, row, [told])
        if unit != "m" and is_number(get(entry, "reached")):
            _beside(axes, row, f"{100 * entry['reached']:.0f} %")
        if row == 0:
            _recorded(axes, entry, offset, percent, len(laws))
            if unit != "m" and is_number(get(entry, "recorded_reached")):
                _beside(axes, len(laws), f"{100 * entry['recorded_reached']:.0f} %")
    axes.plot([], [], color=GREY, linewidth=2.2, label=f"new avalanche that gets there, mean and {percent}")
    law_axis(axes, [*laws, {"id": "recorded"}])
    _label_sensor(axes, sensor, unit, reference)


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
