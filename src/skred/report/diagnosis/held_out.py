"""Figures of predictions of avalanches left out, by the base law and by the augmented one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.evidence.predictive import Predicted
from skred.report.diagnosis.words import AFTER, BEFORE
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.style import GREY, legend_below, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.diagnosis.predict.held_out import HeldOut
    from skred.report.diagnosis.flat import Flat as Diagnosis

FloatArray = NDArray[np.float64]
_MOST_NAMED = 60


@styled
def left_out_figure(found: Diagnosis) -> Figure:
    """Recorded against predicted: speeds at sensors, and runouts."""
    problem, before, after = found.problem, found.before, found.after
    assert before is not None
    is_velocity = np.asarray(problem.readings.is_velocity, dtype=bool)
    reference = problem.campaign.reference_s_m or 0.0
    kinds = [("front speed", is_velocity, unit_text("m s-1"), 0.0), ("runout", ~is_velocity, "m", reference)]
    shown = [kind for kind in kinds if problem.observed[:, kind[1]].any()]
    words = "before and after" if after is not None else "by the base law"
    figure = new_figure(4.5, f"Avalanches left out: recorded against predicted, {words}")
    panels = figure.subplots(1, len(shown), squeeze=False).ravel()
    for axes, (quantity, columns, unit, zero) in zip(panels, shown, strict=True):
        seen = problem.observed[:, columns]
        recorded = problem.values[:, columns][seen] - zero
        first = _of(before, columns, seen, zero)
        second = None if after is None else _of(after, columns, seen, zero)
        _pairs(axes, recorded, first, second)
        of = " from the reference" if quantity == "runout" and problem.campaign.reference_s_m else ""
        of = of or (" s" if quantity == "runout" else "")
        axes.set_xlabel(f"recorded {quantity}{of} [{unit}]")
        axes.set_ylabel(f"predicted from the other avalanches [{unit}]")
    legend_below(figure, panels, columns=2)
    return figure


def _of(held: HeldOut, columns: NDArray[np.bool_], seen: NDArray[np.bool_], zero: float) -> Predicted:
    """Predictions of the readings of some sensors, as rows."""
    return Predicted(*(values[:, columns][seen] - zero for values in held.predicted))


def _pairs(axes: Axes, recorded: FloatArray, before: Predicted, after: Predicted | None) -> None:
    last = before if after is None else after
    ends = [recorded.min(), recorded.max(), np.nanmin(before.mean), np.nanmax(before.mean)]
    ends += [np.nanmin(last.low), np.nanmax(last.high)]
    axes.vlines(
        recorded, last.low, last.high, color="#c9d6e3", linewidth=1.6, zorder=1,
        label="90 % interval" + ("" if after is None else ", with what was missing"),
    )  # fmt: skip
    margin = 0.04 * (max(ends) - min(ends)) or 1.0
    low, high = float(min(ends) - margin), float(max(ends) + margin)
    axes.plot([low, high], [low, high], color=GREY, linewidth=0.9, linestyle="--", label="perfect")
    size = 4.5 if len(recorded) < 150 else 3.0
    axes.plot(
        recorded, before.mean, linestyle="none", marker="o", markersize=size, markerfacecolor="none",
        color=BEFORE, label="base law", zorder=2,
    )  # fmt: skip
    if after is not None:
        axes.plot(
            recorded, after.mean, linestyle="none", marker="o", markersize=size, color=AFTER, alpha=0.85,
            markeredgewidth=0.0, label="with what was missing", zorder=3,
        )  # fmt: skip
    beside = 0.06 * float(np.ptp(recorded)) or margin
    axes.set_xlim(recorded.min() - beside, recorded.max() + beside)
    axes.set_ylim(low, high)


@styled
def scores_figure(found: Diagnosis) -> Figure:
    """Difference of each left-out avalanche's log score, in order."""
    assert found.before is not None and found.after is not None
    difference = found.after.pointwise - found.before.pointwise
    order = np.argsort(difference)
    n = len(order)
    figure = new_figure(3.1, "Left out one at a time: how much better each avalanche is predicted")
    axes = figure.subplots()
    colours = [AFTER if difference[k] >= 0.0 else BEFORE for k in order]
    axes.bar(np.arange(n), difference[order], color=colours, width=0.8)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylabel("difference of log score [nats],\npositive: better with the new term")
    axes.grid(axis="y")
    axes.set_xlim(-0.7, n - 0.3)
    if n <= _MOST_NAMED:
        names = [figure_text(found.problem.campaign.event_ids[k], 14) for k in order]
        axes.set_xticks(np.arange(n), names, rotation=90, fontsize=7 if n <= 40 else 5.5)
    else:
        axes.set_xticks([])
    axes.set_xlabel("avalanche" if n <= _MOST_NAMED else f"{n} avalanches, in order")
    return figure
