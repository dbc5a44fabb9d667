"""Figure of a hierarchical comparison beside the pooled one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.report.comparison.parts import law_axis, practical_band, styles, typeset
from skred.report.shared.document import Document, get, is_hierarchical, passed, side_by_side
from skred.report.shared.numbers import floats, is_number
from skred.report.shared.style import GREY, legend_below, new_figure, styled

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
    practical_band(axes, comparison)
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
    """Difference of elpd of a law that converged."""
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
