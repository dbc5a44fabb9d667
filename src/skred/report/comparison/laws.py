"""Figures that set laws side by side, made from the comparison document alone."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.comparison.explorations import explorations
from skred.report.comparison.likelihoods import likelihoods_figure
from skred.report.comparison.parts import law_axis, practical_band, styles, typeset
from skred.report.comparison.pit import pit_figure
from skred.report.comparison.ranking import ranking_figure
from skred.report.comparison.sensors import new_avalanches_figure, predictions_figure
from skred.report.shared.document import Document, get, is_hierarchical, listed, pareto_k_limit, ranked
from skred.report.shared.drawing import Picture, draw
from skred.report.shared.labels import figure_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats, is_number
from skred.report.shared.style import (
    GREY,
    INK,
    is_narrow,
    legend_below,
    new_figure,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MAX_NAMED_EVENTS = 45
_LOWEST_K = -0.5
COMPARISON_FIGURES = (
    "comparison_elpd", "pointwise", "pareto_k", "predictions", "evidence", "likelihoods", "ranking",
    "loo_pit",
)  # fmt: skip
"""Names of all figures that there may be."""


def save_comparison_figures(comparison: Document, folder: Path) -> dict[str, Picture]:
    """Make the figures that the comparison has numbers for, and write them as PNG.

    Returns
    -------
    dict of Picture
        By name, see `COMPARISON_FIGURES`; likelihoods only of a hierarchical comparison with a pooled one
        beside it.
    """
    predictions = new_avalanches_figure if is_hierarchical(comparison) else predictions_figure
    makers = (
        elpd_figure, pointwise_figure, pareto_k_figure, predictions, evidence_figure, likelihoods_figure,
        ranking_figure, pit_figure,
    )  # fmt: skip
    named = zip(COMPARISON_FIGURES, makers, strict=True)
    drawn = {name: partial(make, comparison) for name, make in named}
    return draw(drawn, folder, explorations=explorations(comparison))


@styled
def elpd_figure(comparison: Document) -> Figure | None:
    """Differences of elpd to the best law, with their standard errors as given and doubled."""
    laws = [law for law in ranked(comparison) if is_number(get(law, "difference", "elpd"))]
    if not laws:
        return None
    colours, markers = styles(comparison)
    best = figure_text(laws[0]["id"])
    title = f"How much worse each law predicts an avalanche left out, against {best}"
    figure = new_figure(1.65 + 0.36 * len(laws), title)
    axes = figure.subplots()
    practical_band(axes, comparison)
    for row, law in enumerate(laws):
        difference, se, doubled = floats([get(law, "difference", k) for k in ("elpd", "se", "se_doubled")])
        colour = colours[law["id"]]
        axes.hlines(row, difference - doubled, difference + doubled, color=colour, linewidth=1.2)
        axes.hlines(row, difference - se, difference + se, color=colour, linewidth=4, alpha=0.55)
        axes.plot(difference, row, marker=markers[law["id"]], color=colour, markersize=6)
        told = f"{law['id']}: {fixed(difference)} nats, standard error {fixed(se)}, doubled {fixed(doubled)}"
        mark(axes, difference, row, [told])
        place = (difference, row)
        axes.annotate(
            typeset(difference), place, (0, 7), textcoords="offset points", ha="center", fontsize=7.5
        )
    axes.plot([], [], color=GREY, linewidth=4, alpha=0.55, label="standard error")
    axes.plot([], [], color=GREY, linewidth=1.2, label="doubled standard error")
    law_axis(axes, laws)
    axes.set_ylim(len(laws) - 0.5, -0.75)
    exact = "" if is_hierarchical(comparison) else "exact "
    axes.set_xlabel(f"difference of elpd ({exact}leave-one-event-out) to the best law [nats]")
    legend_below(figure, [axes], columns=3)
    return figure


@styled
def pointwise_figure(comparison: Document) -> Figure | None:
    """Elpd of each event under each law, less that under the best law."""
    events = listed(comparison, "event_ids")
    laws = [law for law in ranked(comparison) if len(listed(law, "exact", "pointwise")) == len(events)]
    if len(laws) < 2 or not events:
        return None
    colours, markers = styles(comparison)
    best = floats(listed(laws[0], "exact", "pointwise"))
    title = "Which avalanches decide: below 0 the best law predicted the avalanche better"
    figure = new_figure(4.0, title)
    axes = figure.subplots()
    axes.axhline(
        0, color=colours[laws[0]["id"]], linewidth=1.2, label=f"{figure_text(laws[0]['id'], 24)} (best)"
    )
    width = 0.5 if len(events) <= _MAX_NAMED_EVENTS else 0.0
    for k, law in enumerate(laws[1:]):
        difference = floats(listed(law, "exact", "pointwise")) - best
        x = np.arange(len(events)) + width * ((k + 0.5) / (len(laws) - 1) - 0.5)
        colour, failed = colours[law["id"]], set(map(str, listed(law, "exact", "failed_refits")))
        axes.vlines(x, 0, difference, color=colour, linewidth=1.0, alpha=0.7)
        filled = [colour if str(event) not in failed else "#ffffff" for event in events]
        told = [
            f"{event}, {law['id']}: {fixed(one)} nats"
            for event, one in zip(events, difference.tolist(), strict=True)
        ]
        mark(axes, x, difference, told, list(map(str, events)))
        axes.scatter(x, difference, s=20, c=filled, marker=markers[law["id"]], edgecolors=colour, zorder=3)
        total = typeset(float(np.nansum(difference)))
        axes.scatter(
            [],
            [],
            s=20,
            c=colour,
            marker=markers[law["id"]],
            label=f"{figure_text(law['id'], 24)}: sum {total}",
        )
    if any(listed(law, "exact", "failed_refits") for law in laws):
        axes.scatter([], [], s=20, c="#ffffff", edgecolors=GREY, label="hollow: the refit did not converge")
    _event_axis(axes, events)
    axes.set_ylabel("elpd of the event\nless that of the best law [nats]")
    legend_below(figure, [axes], columns=4)
    return figure


def _event_axis(axes: Axes, events: list[Any]) -> None:
    """Events by name; of many only some are named."""
    step = -(-len(events) // (_MAX_NAMED_EVENTS // 2 if is_narrow() else _MAX_NAMED_EVENTS))
    places = range(0, len(events), step)
    axes.set_xticks(places, [figure_text(events[k], 14) for k in places], rotation=90, fontsize=7)
    axes.set_xlim(-0.7, len(events) - 0.3)
    axes.set_xlabel("event" if step == 1 else f"event (one in {step} is named)")
    axes.grid(axis="x")


@styled
def pareto_k_figure(comparison: Document) -> Figure | None:
    """Pareto k of each event under each law: where importance sampling cannot be trusted."""
    events = listed(comparison, "event_ids")
    laws = [law for law in ranked(comparison) if len(listed(law, "loo", "pareto_k")) == len(events)]
    if not laws or not events:
        return None
    colours, markers = styles(comparison)
    limit = pareto_k_limit(comparison)
    need = "were refitted exactly" if is_hierarchical(comparison) else "need an exact refit"
    title = f"Pareto k: avalanches above the line {need}"
    figure = new_figure(3.6, f"{title}\n(values below {typeset(_LOWEST_K)} are drawn there)")
    axes = figure.subplots()
    axes.axhline(limit, color=INK, linewidth=1.0, linestyle="--", label=f"limit {limit:.2f}")
    for law in laws:
        found = floats(listed(law, "loo", "pareto_k"))
        k = np.maximum(found, _LOWEST_K)
        told = [
            f"{event}, {law['id']}: k = {fixed(one)}"
            for event, one in zip(events, found.tolist(), strict=True)
        ]
        mark(axes, np.arange(len(events)), k, told, list(map(str, events)))
        label = figure_text(law["id"], 24)
        axes.scatter(
            np.arange(len(events)),
            k,
            s=18,
            c=colours[law["id"]],
            marker=markers[law["id"]],
            label=label,
            alpha=0.85,
        )
    axes.set_ylim(_LOWEST_K - 0.06, max(axes.get_ylim()[1], limit + 0.15))
    _event_axis(axes, events)
    axes.set_ylabel("Pareto k")
    legend_below(figure, [axes], columns=5)
    return figure


@styled
def evidence_figure(comparison: Document) -> Figure | None:
    """Log evidence of each law, each seed a point."""
    laws = [law for law in ranked(comparison) if is_number(get(law, "evidence", "mean"))]
    if not laws:
        return None
    colours, markers = styles(comparison)
    title = "Evidence: how well each law with its prior foretold the recordings (right is better)"
    figure = new_figure(1.3 + 0.34 * len(laws), title)
    axes = figure.subplots()
    for row, law in enumerate(laws):
        seeds = floats(listed(law, "evidence", "log_evidence"))
        mean = float(get(law, "evidence", "mean"))
        mark(axes, mean, row, [f"{law['id']}: {fixed(mean)}; seeds {', '.join(map(fixed, seeds.tolist()))}"])
        colour = colours[law["id"]]
        axes.scatter(
            seeds,
            np.full(len(seeds), row),
            s=26,
            facecolors="none",
            edgecolors=colour,
            marker=markers[law["id"]],
        )
        axes.plot([mean, mean], [row - 0.28, row + 0.28], color=colour, linewidth=1.6)
        axes.annotate(typeset(mean), (mean, row - 0.3), ha="center", va="bottom", fontsize=7.5)
    axes.scatter([], [], s=26, facecolors="none", edgecolors=GREY, label="one seed of SMC")
    axes.plot([], [], color=GREY, linewidth=1.6, label="mean over the seeds")
    law_axis(axes, laws)
    axes.set_ylim(len(laws) - 0.5, -0.85)
    axes.margins(x=0.08)
    axes.set_xlabel("log evidence [nats]")
    axes.ticklabel_format(axis="x", useOffset=False)
    legend_below(figure, [axes], columns=2)
    return figure
