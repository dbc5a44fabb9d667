"""Figure of what the answer hangs on: its evidence without each avalanche and without kinds of readings."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.diagnosis.words import AFTER, MISMATCH, in_words
from skred.report.shared import document as doc
from skred.report.shared.labels import figure_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import is_number
from skred.report.shared.style import (
    GREY,
    legend_below,
    new_figure,
    side_by_side,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_NAMED = 40
"""Avalanches, or kinds of readings, that are named on the axis; of more only those that the answer needs."""


def has_influence(document: doc.Document) -> bool:
    """Whether the verdict says what its answer hangs on, and no number of it is null."""
    found, key = doc.get(document, "influence"), "log_bayes_factor"
    parts = [*doc.listed(found, "events"), *doc.listed(found, "readings")]
    values = [doc.get(found, key), doc.get(found, "needed"), *(doc.get(one, key) for one in parts)]
    return bool(doc.listed(found, "events")) and all(map(is_number, values))


@styled
def influence_figure(document: doc.Document) -> Figure:
    """Log Bayes factor of the answer without each avalanche, and without kinds of readings."""
    found = doc.get(document, "influence")
    name = figure_text(in_words([found["answer"]])[0], 40)
    figure = new_figure(3.6, f"What the answer hangs on: {name}, again without some of the recordings")
    readings = doc.listed(found, "readings")
    panels = side_by_side(figure, 2, sharey=True, width_ratios=[3, 1.2])
    alarm = doc.get(found, "alarm") or found  # without it in verdicts of older versions
    carried, rival = set(doc.listed(alarm, "carried_by")), doc.get(found, "rival")
    of_name = doc.listed(rival, "carried_by")
    without = {one["event"]: float(one["log_bayes_factor"]) for one in found["events"]}
    events = sorted(without, key=lambda event: without[event])
    _points(panels[0], found, events, [without[event] for event in events], carried, of_name)
    told = [f"without {event}: {without[event]:.1f} nats" for event in events]
    mark(panels[0], np.arange(len(events)), [without[event] for event in events], told, events)
    panels[0].set_xlabel(
        "without avalanche" if len(events) <= _MOST_NAMED else f"without each of {len(events)}"
    )
    panels[0].set_ylabel("log Bayes factor\nagainst nothing [nats]")
    _points(panels[1], found, [_kind(one) for one in readings], [one["log_bayes_factor"] for one in readings])
    values = [one["log_bayes_factor"] for one in readings]
    told = [f"without {_kind(one)}: {value:.1f} nats" for one, value in zip(readings, values, strict=True)]
    mark(panels[1], np.arange(len(readings)), values, told)
    panels[1].set_xlabel("without readings")
    if is_number(left := doc.get(alarm, "without_them")):
        panels[0].plot(
            [(len(carried) - 1) / 2.0], [left], linestyle="none", marker="D", color=MISMATCH,
            label="without all that carry the alarm",
        )  # fmt: skip
    if of_name:
        carrying = [k for k, event in enumerate(events) if event in of_name]
        other = figure_text(in_words([str(doc.get(rival, "id"))])[0], 40)
        panels[0].scatter(
            carrying, [without[events[k]] for k in carrying], s=110, facecolors="none", edgecolors="black",
            label=f"carries the name: without, {other} leads",
        )  # fmt: skip
    legend_below(figure, panels, columns=2)
    return figure


def _points(
    axes: Axes,
    found: dict[str, Any],
    names: list[str],
    values: list[float],
    carried: Set[str] = frozenset(),
    also_told: Sequence[str] = (),
) -> None:
    """One point for each part that is left out, with the evidence of all and what is needed as lines."""
    at = np.arange(len(names))
    axes.axhline(found["log_bayes_factor"], color=AFTER, linewidth=1.0, label="by all recordings")
    axes.axhline(found["needed"], color=GREY, linewidth=1.0, linestyle="--", label="needed for the answer")
    if names:
        colours = [MISMATCH if name in carried else AFTER for name in names]
        axes.vlines(at, values, found["log_bayes_factor"], color=colours, linewidth=1.4, alpha=0.5)
        axes.scatter(at, values, color=colours, s=18, zorder=3)
    told = {one for one, value in zip(names, values, strict=True) if value < found["needed"]}
    told |= {*carried, *also_told}
    shown = names if len(names) <= _MOST_NAMED else [one if one in told else "" for one in names]
    axes.set_xticks(at, [figure_text(one, 16) for one in shown], rotation=90, fontsize=7)
    axes.set_xlim(-0.7, max(len(names), 1) - 0.3)


def _kind(readings: dict[str, Any]) -> str:
    """Some of the readings, and how many they are."""
    what = readings["sensor"] if readings["kind"] == "sensor" else readings["kind"]
    return f"{what} ({readings['n']})"
