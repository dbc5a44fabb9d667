"""Figures of a diagnosis along the track: where something is missing, and the evidence by place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from skred.report.diagnosis.evidence import group_of
from skred.report.diagnosis.words import (
    MISMATCH,
    UNLISTED,
    blamed_sensors,
    colour_of,
    law_title,
    short_title,
    stretch_in,
)
from skred.report.shared import document as doc
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.numbers import is_number
from skred.report.shared.recordings import Recordings, recordings_of
from skred.report.shared.style import GREY, INK, PALE, legend_below, new_figure, styled, tint
from skred.report.shared.track_panels import terrain_profile

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DEPTH = 40.0
"""How far below its highest evidence is shown; what is below stands at the edge [nats]."""
_SHORT = 0.1
"""Share of the part shown below which a stretch has a point in its middle: its line is hard to see."""


class Place(NamedTuple):
    """One shape of a mechanism that acts at a place or at a sensor.

    Attributes
    ----------
    first_m, last_m : float
    factor : float
        Log Bayes factor against nothing [nats].
    best : bool
        Whether it is the mechanism's most probable.
    """

    first_m: float
    last_m: float
    factor: float
    best: bool


@styled
def where_figure(document: doc.Document, tree: xr.DataTree) -> Figure:
    """The track with its sensors and the mismatch, the missing retardation, and what came by."""
    recordings = recordings_of(tree)
    force = tree["force"].to_dataset() if "force" in tree.children else None
    what = "No alarm: the missing force along the track" if force is not None else "The track and its sensors"
    what = "Where something is missing" if doc.get(document, "alarm") else what
    ratios = [1.1, 1.5, 0.75] if force is not None else [1.0]
    title = f"{what}\n{figure_text(law_title(document), 80)}"
    figure = new_figure(6.6 if force is not None else 3.2, title)
    panels = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios).ravel()
    ends = [] if force is None else [float(force["s"].values[0]), float(force["s"].values[-1])]
    window = _window(recordings, [*ends, *(stretch_in(doc.get(document, "location")) or ())])
    terrain_profile(panels[0], recordings, window, named=True)
    _blamed(panels[0], document, recordings)
    panels[0].set_ylabel("elevation [m]")
    _elevations(panels[0], recordings, window)
    if force is not None:
        _retardation(panels[1], document, force)
        _covered(panels[2], force)
    for axes in panels:
        _marks(axes, document, recordings.reference_s_m)
    panels[0].set_xlim(*window)
    panels[-1].set_xlabel("s along the track [m], the part with recordings")
    legend_below(figure, panels, columns=2)
    return figure


def _window(recordings: Recordings, more: list[float]) -> tuple[float, float]:
    """The part with recordings, and a little more."""
    ends = [*(recordings.recorded_range() or (0.0, recordings.length_m)), *more]
    margin = 0.05 * (max(ends) - min(ends)) or 1.0
    return max(min(ends) - margin, 0.0), min(max(ends) + margin, recordings.length_m)


def _elevations(axes: Axes, recordings: Recordings, window: tuple[float, float]) -> None:
    """Limit the elevations to those of the part that is shown."""
    s_m, z_m = recordings.track_s_m, recordings.track_z_m
    inside = z_m[(s_m >= window[0]) & (s_m <= window[1])]
    z = np.concatenate([inside, np.interp(window, s_m, z_m)])
    margin = 0.08 * (float(np.ptp(z)) or 1.0)
    axes.set_ylim(z.min() - margin, z.max() + margin)


def _marks(axes: Axes, document: doc.Document, reference: float | None) -> None:
    """The stretches that the verdict names, and the campaign's reference."""
    named = [("what is missing", MISMATCH, 0.18, doc.get(document, "location"))]
    seconds = doc.listed(document, "mechanisms")[1:]
    named += [("the second", "#E69F00", 0.25, doc.get(one, "location")) for one in seconds]
    for words, colour, alpha, location in named:
        stretch = stretch_in(location)
        if stretch is not None:
            label = f"{words}: s = {stretch[0]:.0f} to {stretch[1]:.0f} m"
            axes.axvspan(*stretch, color=colour, alpha=alpha, linewidth=0, label=label, zorder=0)
    if reference is not None:
        label = f"reference, s = {reference:.0f} m"
        axes.axvline(reference, color=GREY, linewidth=0.9, linestyle="--", label=label)


def _blamed(axes: Axes, document: doc.Document, recordings: Recordings) -> None:
    """Sensors that the verdict blames."""
    blamed = blamed_sensors(document)
    for _, sensor, middle in recordings.placed():
        if sensor.id in blamed:
            axes.plot(
                middle, recordings.elevation(middle), marker="o", markersize=11, markeredgewidth=1.8,
                markerfacecolor="none", color=MISMATCH, linestyle="none", label="sensor that reads wrongly",
            )  # fmt: skip


def _retardation(axes: Axes, document: doc.Document, force: xr.Dataset) -> None:
    s_m = force["s"].values
    axes.fill_between(
        s_m, force["low"].values, force["high"].values, color=tint(colour_of(document, UNLISTED), 0.35),
        linewidth=0, label="holds the whole profile with probability 0.9",
    )  # fmt: skip
    axes.plot(s_m, force["mean"].values, color=INK, linewidth=1.4, label="missing retardation, mean")
    shown = slice(None, None, max(1, len(s_m) // 30))
    rows = zip(*(force[name].values[shown].tolist() for name in ("s", "mean", "low", "high")), strict=True)
    told = [f"s = {s:.0f} m: {mean:.2f} m/s² (band {low:.2f} to {high:.2f})" for s, mean, low, high in rows]
    mark(axes, s_m[shown], force["mean"].values[shown], told)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    of_fast = "\nof a fast front" if doc.get(document, "report", "force", "nil_at_typical_speed") else "\n"
    axes.set_ylabel(f"missing retardation{of_fast} [{unit_text('m s-2')}],\npositive brakes")
    axes.grid(axis="y")
    _resolution(axes, doc.get(document, "report", "force", "resolution_m"), float(s_m[0]), float(np.ptp(s_m)))


def _resolution(axes: Axes, resolution_m: Any, start: float, length: float) -> None:
    """The length over which the profile can tell places apart, as a bar below it."""
    if not is_number(resolution_m):
        return
    low, high = axes.get_ylim()
    width = min(resolution_m, length)
    axes.set_ylim(low - 0.16 * (high - low), high)
    level = low - 0.05 * (high - low)
    axes.errorbar(
        start + 0.5 * width, level, xerr=0.5 * width, color=INK, capsize=3, linewidth=1.2,
        label=f"resolution, {resolution_m:.0f} m",
    )  # fmt: skip


def _covered(axes: Axes, force: xr.Dataset) -> None:
    s_m, percent = force["s"].values, 100.0 * force["covered"].values
    axes.fill_between(s_m, 0.0, percent, color=PALE, linewidth=0)
    axes.plot(s_m, percent, color=GREY, linewidth=1.0)
    axes.set_ylim(0.0, 108.0)
    axes.set_yticks([0, 50, 100])
    axes.set_ylabel("avalanches that\ncame by [%]")


def places_of(tree: xr.DataTree, number: int) -> dict[str, list[Place]]:
    """Places of each mechanism that acts at some, or at sensors of speed, in a comparison."""
    if group_of("shapes", number) not in tree.children:
        return {}
    sensors = {s.id: (s.s_from_m, s.s_to_m) for _, s, _ in recordings_of(tree).placed()}
    shapes = tree[group_of("shapes", number)].to_dataset()
    names = ("mechanism", "s_from", "s_to", "sensor", "log_bayes_factor", "best")
    places: dict[str, list[Place]] = {}
    for name, first, last, sensor, factor, best in zip(*(shapes[n].values for n in names), strict=True):
        ends = sensors.get(str(sensor), (float(first), float(last)))
        if np.isfinite(ends).all() and np.isfinite(factor):
            places.setdefault(str(name), []).append(Place(*ends, float(factor), bool(best)))
    return places


@styled
def places_figure(document: doc.Document, tree: xr.DataTree, number: int) -> Figure:
    """Log Bayes factor of each mechanism that acts at a place, place by place."""
    places, recordings = places_of(tree, number), recordings_of(tree)
    which = " given the first finding" if number else ""
    title = f"Evidence by place{which}\nEach bar or point: one place, for all coefficients together"
    figure = new_figure(1.2 + 1.35 * len(places), title)
    panels = figure.subplots(len(places), 1, sharex=True, squeeze=False).ravel()
    best = [end for shapes in places.values() for one in shapes if one.best for end in one[:2]]
    window = _window(recordings, best)
    for axes, (name, shapes) in zip(panels, places.items(), strict=True):
        _at_places(axes, shapes, colour_of(document, name), _SHORT * (window[1] - window[0]))
        axes.set_title(figure_text(short_title(document, name), 70), fontsize=8.5)
        for _, _, middle in recordings.placed():
            axes.axvline(middle, ymin=0.94, color=INK, linewidth=0.8, label="sensors of speed")
        if recordings.reference_s_m is not None:
            label = f"reference, s = {recordings.reference_s_m:.0f} m"
            axes.axvline(recordings.reference_s_m, color=GREY, linewidth=0.9, linestyle="--", label=label)
    panels[0].set_xlim(*window)
    figure.supylabel("log Bayes factor against nothing [nats]", fontsize=8.5)
    panels[-1].set_xlabel("s along the track [m]")
    legend_below(figure, panels, columns=2)
    return figure


def _at_places(axes: Axes, places: list[Place], colour: str, short_m: float) -> None:
    factors = [one.factor for one in places]
    top = max(*factors, 0.0)
    floor = min(top, max(min(factors), -3.0, top - _DEPTH)) - 1.0
    for one in places:
        shade = MISMATCH if one.best else tint(colour, 0.55)
        height, order = max(one.factor, floor), 4 if one.best else 2
        axes.hlines(
            height, one.first_m, one.last_m, color=shade, linewidth=2.6 if one.best else 1.2, zorder=order,
            label="most probable" if one.best else "_other",
        )  # fmt: skip
        told = f"s = {one.first_m:.0f} to {one.last_m:.0f} m: {one.factor:.1f} nats"
        mark(axes, 0.5 * (one.first_m + one.last_m), height, [told])
        if one.last_m - one.first_m < short_m:
            middle = 0.5 * (one.first_m + one.last_m)
            axes.plot(middle, height, marker="o", markersize=4, color=shade, zorder=order)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylim(floor - 0.5, top + max(1.0, 0.12 * (top - floor)))
    axes.grid(axis="y")
