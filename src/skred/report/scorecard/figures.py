"""Figures of a scorecard: alarms, detection and names against signal-to-noise, confusion.

Every figure is made from the scorecard's document alone; one without data is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtr

from skred.report.scorecard.panels import baselines_figure, gain_figure, places_figure, reliability_figure
from skred.report.shared.document import Document, get, listed
from skred.report.shared.drawing import Picture, draw
from skred.report.shared.labels import figure_text, name_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed
from skred.report.shared.style import (
    GREY,
    INK,
    folded,
    grow,
    is_narrow,
    legend_below,
    new_figure,
    shade_map,
    styled,
    tint,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DIAGNOSIS, BAR = "#0072B2", "#D55E00"
"""What was measured; what was asked for."""
SCORECARD_FIGURES = (
    "false_alarms", "power", "confusion", "confusion_classes", "places", "reliability", "gain", "baselines",
)  # fmt: skip
"""Names of all figures that there may be."""
_KINDS = ("sparse", "dense")
_SNR = (1.5, 13.0)


def save_scorecard_figures(document: Document, folder: Path) -> dict[str, Picture]:
    """Make the figures of a scorecard, and write them as PNG.

    Returns
    -------
    dict
        By name: ``false_alarms``, ``power``, ``confusion``, ``confusion_classes``, ``places``,
        ``reliability``, ``gain`` and ``baselines``, as far as there are data for them.
    """
    return draw({name: partial(make, document) for name, make in _makers().items()}, folder)


def _makers() -> dict[str, Callable[[Document], Figure | None]]:
    return {
        "false_alarms": false_alarms_figure,
        "power": power_figure,
        "confusion": lambda one: confusion_figure(one, "mechanisms"),
        "confusion_classes": lambda one: confusion_figure(one, "classes"),
        "places": places_figure,
        "reliability": reliability_figure,
        "gain": gain_figure,
        "baselines": baselines_figure,
    }


def own_scores(document: Document, kind: str, part: str = "open") -> Any:
    """Scores of the diagnosis."""
    return get(document, "methods", str(get(document, "diagnosis")), part, kind)


@styled
def false_alarms_figure(document: Document) -> Figure | None:
    """Share of alarms where nothing is hidden, by kind, with upper limits and acceptance criteria."""
    found = get(own_scores(document, "all"), "false_alarms")
    bars = get(document, "standards", "bars_false_alarms")
    rows = [("nulls, all", found["all"], bars["all"]), ("plain", found["plain"], bars["plain"])]
    rows += [("contaminated, all", found["nasty"], bars["nasty"])]
    rows += [(name_text(name), one, bars["nasty"]) for name, one in found["by_nastiness"].items()]
    for kind in _KINDS:
        rows.append((f"{kind}, all", get(own_scores(document, kind), "false_alarms", "all"), bars["all"]))
    rows = [row for row in rows if row[1]["n"]]
    if not rows:
        return None
    figure = new_figure(1.15 + 0.3 * len(rows), "False alarms where nothing is hidden")
    axes = figure.subplots()
    for place, (_, one, bar) in enumerate(rows):
        limit = one["upper_limit_one_sided_95"]
        axes.plot(
            [0.0, limit],
            [place, place],
            color=tint(DIAGNOSIS, 0.45),
            linewidth=5,
            solid_capstyle="butt",
            label="one-sided 95 % upper limit",
        )
        axes.plot(
            one["share"], place, "o", color=DIAGNOSIS, markersize=5, label="share of alarms", clip_on=False
        )
        axes.plot(
            [bar, bar],
            [place - 0.35, place + 0.35],
            color=BAR,
            linewidth=1.6,
            label="acceptance criterion for the upper limit",
        )
        told = f"{rows[place][0]}: {one['hits']} of {one['n']}, upper limit {fixed(limit)}"
        mark(axes, one["share"], place, [f"{told}, criterion {fixed(bar)}"])
        axes.text(max(limit, bar) + 0.008, place, f"{one['hits']} of {one['n']}", va="center", fontsize=7.5)
    axes.set_yticks(range(len(rows)), [figure_text(row[0], 30) for row in rows])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(
        0.0, min(1.12, max(0.2, 1.15 * max(row[1]["upper_limit_one_sided_95"] for row in rows) + 0.03))
    )
    axes.set_xlabel("share of trials [-]")
    axes.grid(axis="x")
    legend_below(figure, [axes], columns=3)
    return figure


@styled
def power_figure(document: Document) -> Figure | None:
    """Detection, and right first names, against signal-to-noise, with the linearised ceilings."""
    if not any(get(own_scores(document, kind), "detection", "all", "n") for kind in _KINDS):
        return None
    figure = new_figure(6.2, "What is found and what is named, against signal-to-noise")
    if is_narrow():
        grow(figure, 1.7)
    rows, columns = (4, 1) if is_narrow() else (2, 2)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).reshape(2, 2)
    for column, kind in enumerate(_KINDS):
        _detection(panels[0, column], document, kind)
        _names(panels[1, column], document, kind)
        panels[1, column].set_xlabel("signal-to-noise [-]")
    panels[0, 0].set_ylabel("found [-]")
    panels[1, 0].set_ylabel("right name [-]")
    panels[0, 0].set(xlim=_SNR, ylim=(-0.03, 1.03))
    legend_below(figure, panels.ravel(), columns=3)
    return figure


def _detection(axes: Axes, document: Document, kind: str) -> None:
    scores, standards = own_scores(document, kind), get(document, "standards")
    snr = np.linspace(*_SNR, 100)
    axes.plot(
        snr,
        ndtr(snr - standards["detection_limit_score"]),
        color=INK,
        linestyle="--",
        linewidth=1.0,
        label="linearised ceiling",
    )
    curve = get(scores, "detection", "fit", "curve")
    if curve is not None:
        axes.fill_between(
            curve["snr"],
            curve["low"],
            curve["high"],
            color=tint(DIAGNOSIS, 0.2),
            linewidth=0,
            label="95 % band of the fit",
        )
        axes.plot(curve["snr"], curve["value"], color=DIAGNOSIS, linewidth=1.4, label="logistic fit")
    _binned(axes, listed(scores, "detection", "by_snr"), lambda one: one, DIAGNOSIS, "o", "found")
    bars = standards["bars_detection"]
    axes.plot(
        [float(at) for at in bars],
        list(bars.values()),
        "x",
        color=BAR,
        markersize=7,
        markeredgewidth=1.8,
        label="acceptance criterion",
    )
    axes.set_title(f"{kind}: found, n = {get(scores, 'detection', 'all', 'n')}")


def _names(axes: Axes, document: Document, kind: str) -> None:
    scores, standards = own_scores(document, kind), get(document, "standards")
    axes.plot(
        standards["ceiling_snr"],
        standards["ceiling_right_first_name"][kind],
        color=INK,
        linestyle="--",
        linewidth=1.0,
        label="linearised ceiling",
    )
    rows = listed(scores, "naming", "by_snr")
    _binned(axes, rows, lambda one: one["right_set"], "#009E73", "D", "right name in the set", shift=0.14)
    _binned(axes, rows, lambda one: one["right_first_name"], DIAGNOSIS, "s", "right first name", shift=-0.14)
    axes.plot(
        [7.0, 7.0],
        standards["bars_naming"][kind],
        "x",
        color=BAR,
        markersize=7,
        markeredgewidth=1.8,
        label="acceptance criterion",
    )
    axes.set_title(f"{kind}: named, n = {get(scores, 'naming', 'all', 'n')}")


def _binned(
    axes: Axes, rows: Sequence[Document], pick: Callable[[Any], Any], colour: str, marker: str, label: str,
    *, shift: float = 0.0,
) -> None:  # fmt: skip
    """Shares of bins of signal-to-noise with their intervals, at the middle of each bin."""
    known = [(0.5 * (row["snr_from"] + row["snr_to"]), pick(row)) for row in rows if pick(row)["n"]]
    if not known:
        return
    x = np.array([middle for middle, _ in known]) + shift
    value, low, high = (np.array([one[key] for _, one in known]) for key in ("share", "low", "high"))
    told = [
        f"{label} {fixed(y)} ({fixed(a)} to {fixed(b)})" for y, a, b in zip(value, low, high, strict=True)
    ]
    mark(axes, x, value, told)
    axes.errorbar(
        x,
        value,
        [value - low, high - value],
        color=colour,
        fmt=marker,
        markersize=4.5,
        elinewidth=1.0,
        label=label,
    )


@styled
def confusion_figure(document: Document, over: str) -> Figure | None:
    """Counts of what was said, for each kind of truth."""
    parts = [get(own_scores(document, "all", part), "confusion", over) for part in ("open", "masked")]
    rows, columns, counts = _added_up(parts)
    if not rows:
        return None
    words = f"What was hidden (rows) and what was said (columns), by {name_text(over)}; counts of trials"
    figure = new_figure(1.9 + (0.33 if is_narrow() else 0.27) * len(rows), words)
    axes = figure.subplots()
    totals = counts.sum(axis=1, keepdims=True)
    shades = counts / np.maximum(totals, 1)
    axes.imshow(shades, cmap=shade_map(DIAGNOSIS), vmin=0.0, vmax=1.25, aspect="auto")
    for row, column in zip(*np.nonzero(counts), strict=True):
        axes.text(
            column,
            row,
            str(counts[row, column]),
            ha="center",
            va="center",
            fontsize=6.5 if is_narrow() else 7.5,
            color="white" if shades[row, column] > 0.45 else INK,
        )
        if rows[row] == columns[column]:
            axes.add_patch(_frame(column, row))
    axes.set_xticks(
        range(len(columns)),
        [_short_label(name) for name in columns],
        rotation=90 if is_narrow() else 40,
        ha="right",
        va="center" if is_narrow() else "top",
        rotation_mode="anchor",
        fontsize=6.5 if is_narrow() else None,
    )
    names = [f"{_label(name)} ({int(n)})" for name, n in zip(rows, totals[:, 0], strict=True)]
    axes.set_yticks(
        range(len(rows)),
        [folded(name, 22) for name in names],
        fontsize=7 if is_narrow() else None,
    )
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
    axes.grid(which="minor", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    return figure


def _label(name: str) -> str:
    return figure_text(name_text(name), 60).replace(" / ", ",\n" if len(name) > 36 else ", ")


def _short_label(name: str) -> str:
    """A label for a column: of a class its first member."""
    first, _, rest = name.partition(" / ")
    return figure_text(name_text(first), 30) + (" ..." if rest else "")


def _frame(column: int, row: int) -> Any:
    """A frame around what was named rightly."""
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, fill=False, edgecolor=GREY, linewidth=1.2)


def _added_up(tables: Sequence[Document]) -> tuple[list[str], list[str], Any]:
    """Tables of counts added, over all of their rows and columns."""
    rows = list(dict.fromkeys(name for table in tables for name in table["rows"]))
    columns = list(dict.fromkeys(name for table in tables for name in table["columns"]))
    last = ("unexplained", "nothing_missing", "cannot_tell", "crash")
    columns = [name for name in columns if name not in last] + [name for name in last if name in columns]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for table in tables:
        for row, line in zip(table["rows"], table["counts"], strict=True):
            for column, n in zip(table["columns"], line, strict=True):
                counts[rows.index(row), columns.index(column)] += n
    return rows, columns, counts
