"""More figures of a scorecard: places, stated probabilities, gain on fresh avalanches, baselines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.shared.document import Document, get, listed
from skred.report.shared.labels import figure_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats
from skred.report.shared.style import (
    GREY,
    INK,
    folded,
    legend_below,
    new_figure,
    side_by_side,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"sparse": "#D55E00", "dense": "#0072B2"}
_MARKERS = {"sparse": "s", "dense": "o"}
_LEAST_M = 1.0
_TICKS_M = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)


def _own(document: Document, kind: str) -> Any:
    return get(document, "methods", str(get(document, "diagnosis")), "open", kind)


@styled
def places_figure(document: Document) -> Figure | None:
    """Place error of each trial against signal-to-noise, and the share of trials below an error."""
    lines = [line for line in listed(document, "trials") if line["place_error_m"] is not None]
    if not lines:
        return None
    figure = new_figure(3.7, "Distance between the middles of the stated and the true stretch")
    points, shares = side_by_side(figure, 2)
    for kind, colour in _COLOURS.items():
        those = [line for line in lines if line["kind"] == kind]
        error = np.maximum([line["place_error_m"] for line in those], _LEAST_M)
        for right, face in ((True, colour), (False, "white")):
            chosen = [bool(line["right"] in ("right", "in the set")) is right for line in those]
            words = f"{kind}, {'right name in the set' if right else 'another name, or none'}"
            points.plot(
                np.array([line["snr"] for line in those])[chosen],
                error[chosen],
                linestyle="none",
                marker=_MARKERS[kind],
                markersize=4.5,
                color=colour,
                markerfacecolor=face,
                label=words,
            )
        told = [
            f"{line['trial']}: snr {fixed(line['snr'], 1)}, error {fixed(line['place_error_m'], 0)} m"
            for line in those
        ]
        mark(points, [line["snr"] for line in those], error, told, [str(line["trial"]) for line in those])
        if len(those):
            steps = np.arange(1, len(error) + 1) / len(error)
            shares.step(
                np.r_[_LEAST_M, np.sort(error)], np.r_[0.0, steps], where="post", color=colour, linewidth=1.4
            )
    bar = get(document, "standards", "bar_place_m")
    points.axhline(
        bar, color=INK, linestyle="--", linewidth=1.0, label="acceptance criterion for the median, dense"
    )
    shares.axvline(bar, color=INK, linestyle="--", linewidth=1.0)
    shares.axhline(0.5, color=GREY, linewidth=0.7)
    points.set(yscale="log", xlabel="signal-to-noise [-]", ylabel="error [m]")
    shares.set(xscale="log", xlabel="error [m]", ylabel="share of trials [-]", ylim=(0.0, 1.02))
    every = np.maximum([line["place_error_m"] for line in lines], _LEAST_M)
    ends = 0.8 * min(float(every.min()), 20.0), 1.25 * max(float(every.max()), 200.0)
    points.set_ylim(*ends)
    shares.set_xlim(*ends)
    ticks = [tick for tick in _TICKS_M if ends[0] <= tick <= ends[1]]
    for axis in (points.yaxis, shares.xaxis):
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)
    points.grid(axis="y")
    shares.grid()
    legend_below(figure, [points], columns=3)
    return figure


@styled
def reliability_figure(document: Document) -> Figure | None:
    """How often what was given a probability is true: of the most probable id, and of all ids."""
    found = get(_own(document, "all"), "probability")
    if found is None:
        return None
    figure = new_figure(4.5, "Do stated probabilities mean what they say?")
    panels = side_by_side(figure, 2, sharey=True)
    for axes, key, words in zip(
        panels, ("top_id", "all_ids"), ("the most probable id", "all ids"), strict=True
    ):
        _reliability(axes, found[key], words)
    panels[0].set_ylabel("share true [-]")
    legend_below(figure, panels, columns=3)
    return figure


def _reliability(axes: Axes, found: Document, words: str) -> None:
    axes.plot([0, 1], [0, 1], color=INK, linestyle="--", linewidth=1.0, label="as stated")
    rows = [row for row in listed(found, "bins") if row["n"]]
    x, y, low, high = (
        np.array([row[key] for row in rows]) for key in ("mean_stated", "share", "low", "high")
    )
    if rows:
        axes.errorbar(
            x,
            y,
            [y - low, high - y],
            color=_COLOURS["dense"],
            fmt="o",
            markersize=4.5,
            elinewidth=1.0,
            label="share true, 95 % interval",
        )
    for row, place in zip(rows, x, strict=True):
        told = f"stated {fixed(row['mean_stated'])}, true {fixed(row['share'])}"
        mark(
            axes,
            place,
            row["share"],
            [f"{told} ({fixed(row['low'])} to {fixed(row['high'])}), n = {row['n']}"],
        )
        axes.text(place, -0.075, str(row["n"]), ha="center", va="center", fontsize=6.5, color=GREY)
    ece, expected = fixed(found["ece"], 3), fixed(get(found, "ece_expected_if_calibrated"), 3)
    axes.set_title(f"{words}\nECE {ece}, {expected} expected if calibrated")
    axes.set(
        xlim=(-0.03, 1.03), ylim=(-0.12, 1.03), xlabel="stated probability [-]; below: number of statements"
    )
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.grid()


@styled
def gain_figure(document: Document) -> Figure | None:
    """Gain on fresh avalanches against the gain that held-out avalanches promised."""
    found = {kind: get(_own(document, kind), "gain") for kind in _COLOURS}
    if not any(one["n"] for one in found.values()):
        return None
    ratio = get(_own(document, "all"), "gain", "realised_over_promised")
    slope = get(_own(document, "all"), "gain", "slope_through_origin")
    title = "Gain of the log score per avalanche:\npromised by those left out, realised on fresh ones"
    figure = new_figure(4.8, title, width=6.0)
    axes = figure.subplots()
    for kind, one in found.items():
        if one["n"]:
            axes.plot(
                floats(one["promised_nats_per_event"]),
                floats(one["realised_nats_per_event"]),
                _MARKERS[kind],
                color=_COLOURS[kind],
                markersize=4.5,
                label=f"{kind}, n = {one['n']}",
            )
    ends = np.array(axes.get_xlim())
    axes.plot(ends, ends, color=INK, linestyle="--", linewidth=1.0, label="as promised")
    if slope["value"] is not None:
        label = f"through the origin, slope {fixed(slope['value'])}"
        axes.plot(ends, slope["value"] * ends, color=GREY, linewidth=1.2, label=label)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set_xlim(*ends)
    axes.set_title(f"realised over promised, ratio of sums: {fixed(ratio['value'])}"
                   f" ({fixed(ratio['low'])} to {fixed(ratio['high'])})")  # fmt: skip
    axes.set(xlabel="promised [nats per avalanche]", ylabel="realised [nats per avalanche]")
    axes.grid()
    legend_below(figure, [axes], columns=2)
    return figure


@styled
def baselines_figure(document: Document) -> Figure | None:
    """Right first names of each baseline and of the diagnosis at equal false alarms."""
    paired = get(document, "paired") or {}
    names = [
        name for name, one in paired.items() if get(one, "all", "right_first_name", "difference") is not None
    ]
    if not names:
        return None
    figure = new_figure(
        1.6 + 0.42 * len(names), "Right first names at equal false alarms, on the same trials"
    )
    shares, differences = side_by_side(figure, 2, sharey=True)
    for shift, (kind, colour) in zip((-0.14, 0.14), _COLOURS.items(), strict=True):
        for row, name in enumerate(names):
            one = get(paired, name, kind, "right_first_name")
            if one["difference"] is None:
                continue
            y = row + shift
            style: dict[str, Any] = {"color": colour, "markersize": 5}
            shares.plot([one["theirs"], one["ours"]], [y, y], color=colour, linewidth=0.8)
            shares.plot(one["theirs"], y, "o", markerfacecolor="white", label=f"{kind}: baseline", **style)
            shares.plot(one["ours"], y, "o", label=f"{kind}: diagnosis", **style)
            differences.plot([one["low"], one["high"]], [y, y], color=colour, linewidth=1.2)
            differences.plot(one["difference"], y, _MARKERS[kind], **style)
    differences.axvline(0.0, color=INK, linewidth=0.8)
    shares.set_yticks(range(len(names)), [folded(figure_text(name, 34), 14) for name in names])
    shares.set_ylim(len(names) - 0.5, -0.5)
    shares.set(xlim=(-0.03, 1.03), xlabel="right first name [-]")
    differences.set_xlabel("diagnosis less baseline, 95 % interval [-]")
    for axes in (shares, differences):
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x")
    legend_below(figure, [shares], columns=4)
    return figure
