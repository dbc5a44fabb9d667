"""Figures of predictions of avalanches left out, by the base law and by the augmented one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.report.diagnosis.words import AFTER, BEFORE
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed
from skred.report.shared.recordings import Recordings, recordings_of
from skred.report.shared.style import (
    GREY,
    legend_below,
    new_figure,
    side_by_side,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Band = tuple[FloatArray, FloatArray, FloatArray]
"""Mean, and 5 % and 95 % quantiles."""
_MOST_NAMED = 60


def is_compared(tree: xr.DataTree) -> bool:
    """Whether avalanches left out were also predicted with something added."""
    return "held_out" in tree.children and "after" in tree["held_out"].to_dataset()["when"].values


@styled
def left_out_figure(tree: xr.DataTree) -> Figure:
    """Recorded against predicted: speeds at sensors, and runouts."""
    recordings, compared = recordings_of(tree), is_compared(tree)
    reference = recordings.reference_s_m or 0.0
    is_runout, observed = recordings.is_runout, recordings.observed
    kinds = [("front speed", ~is_runout, unit_text("m s-1"), 0.0), ("runout", is_runout, "m", reference)]
    shown = [kind for kind in kinds if observed[:, kind[1]].any()]
    words = "before and after" if compared else "by the base law"
    figure = new_figure(4.5, f"Avalanches left out: recorded against predicted, {words}")
    panels = side_by_side(figure, max(len(shown), 1))
    for axes, (quantity, columns, unit, zero) in zip(panels, shown, strict=False):
        seen = observed[:, columns]
        before = _predicted(tree, "before", columns, seen, zero)
        after = _predicted(tree, "after", columns, seen, zero) if compared else None
        _pairs(axes, recordings.values[:, columns][seen] - zero, before, after)
        _tell(axes, recordings, columns, (before, after), zero, unit)
        of = "" if quantity != "runout" else " from the reference" if recordings.reference_s_m else " s"
        axes.set_xlabel(f"recorded {quantity}{of} [{unit}]")
        axes.set_ylabel(f"predicted from the other avalanches [{unit}]")
    legend_below(figure, panels, columns=2)
    return figure


def _tell(
    axes: Axes,
    recordings: Recordings,
    columns: BoolArray,
    bands: tuple[Band, Band | None],
    zero: float,
    unit: str,
) -> None:
    """Say of each point which avalanche and sensor it is, what was recorded and what predicted."""
    numbers = np.flatnonzero(columns)
    places = np.argwhere(recordings.observed[:, columns])
    values = [recordings.values[event, numbers[column]] - zero for event, column in places]
    decimals = 0 if unit == "m" else 1
    before, after = bands
    last = after or before
    words = []
    for k, (event, column) in enumerate(places):
        name = f"{recordings.event_ids[event]}, {recordings.sensors[numbers[column]].id}"
        told = f"{name}\nrecorded {fixed(float(values[k]), decimals)} {unit}"
        told += f"\npredicted {fixed(float(before[0][k]), decimals)}"
        told += "" if after is None else f", with what was missing {fixed(float(after[0][k]), decimals)}"
        words.append(
            f"{told} (90 %: {fixed(float(last[1][k]), decimals)} to {fixed(float(last[2][k]), decimals)})"
        )
    mark(axes, values, last[0], words, [recordings.event_ids[event] for event, _ in places])


def _predicted(tree: xr.DataTree, when: str, columns: BoolArray, seen: BoolArray, zero: float) -> Band:
    """Predictions of the readings of some sensors, one after the other."""
    held = tree["held_out"].to_dataset().sel(when=when)
    mean, low, high = (
        held[name].transpose("event", "sensor").values[:, columns][seen] - zero
        for name in ("mean", "low", "high")
    )
    return mean, low, high


def _pairs(axes: Axes, recorded: FloatArray, before: Band, after: Band | None) -> None:
    mean, low, high = before if after is None else after
    axes.vlines(
        recorded, low, high, color="#c9d6e3", linewidth=1.6, zorder=1,
        label="90 % interval" + ("" if after is None else ", with what was missing"),
    )  # fmt: skip
    ends = [f(values) for values in (recorded, before[0], low, high) for f in (np.nanmin, np.nanmax)]
    margin = 0.04 * (max(ends) - min(ends)) or 1.0
    line = [float(min(ends) - margin), float(max(ends) + margin)]
    axes.plot(line, line, color=GREY, linewidth=0.9, linestyle="--", label="perfect")
    size = 4.5 if len(recorded) < 150 else 3.0
    axes.plot(
        recorded, before[0], linestyle="none", marker="o", markersize=size, markerfacecolor="none",
        color=BEFORE, label="base law", zorder=2,
    )  # fmt: skip
    if after is not None:
        axes.plot(
            recorded, mean, linestyle="none", marker="o", markersize=size, color=AFTER, alpha=0.85,
            markeredgewidth=0.0, label="with what was missing", zorder=3,
        )  # fmt: skip
    beside = 0.06 * float(np.ptp(recorded)) or margin
    axes.set_xlim(recorded.min() - beside, recorded.max() + beside)
    axes.set_ylim(*line)


@styled
def scores_figure(tree: xr.DataTree) -> Figure:
    """Difference of each left-out avalanche's log score, in order."""
    held = tree["held_out"].to_dataset()
    score = held["log_score"].transpose("when", "event")
    difference = np.asarray(score.sel(when="after").values - score.sel(when="before").values, dtype=float)
    order = np.argsort(difference)
    n = len(order)
    figure = new_figure(3.1, "Left out one at a time: how much better each avalanche is predicted")
    axes = figure.subplots()
    colours = [AFTER if difference[k] >= 0.0 else BEFORE for k in order]
    axes.bar(np.arange(n), difference[order], color=colours, width=0.8)
    names = [str(held["event"].values[k]) for k in order]
    told = [f"{name}: {change:+.1f} nats" for name, change in zip(names, difference[order], strict=True)]
    mark(axes, np.arange(n), difference[order], told, names)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylabel("difference of log score [nats],\npositive: better with the new term")
    axes.grid(axis="y")
    axes.set_xlim(-0.7, n - 0.3)
    if n <= _MOST_NAMED:
        axes.set_xticks(
            np.arange(n),
            [figure_text(name, 14) for name in names],
            rotation=90,
            fontsize=7 if n <= 40 else 5.5,
        )
    else:
        axes.set_xticks([])
    axes.set_xlabel("avalanche" if n <= _MOST_NAMED else f"{n} avalanches, in order")
    return figure
