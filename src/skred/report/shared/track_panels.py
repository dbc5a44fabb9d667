"""What every figure along the track has: recordings, runouts, terrain, and the reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.shared.draws import spread
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.marks import mark, notes_of
from skred.report.shared.style import (
    GREY,
    INK,
    RECORDED,
    is_narrow,
    legend_below,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.report.shared.recordings import Recordings

_MAX_NAMED = 20
"""Names that stand beside each other; of more sensors one in two, one in three, ... is named."""
_ZOOM_BELOW = 0.6
"""Where all recordings lie in less than this share of the track, that part is shown enlarged."""


def track_figure(
    recordings: Recordings, title: str, draw: Callable[[Axes], None], *, top: float, start: tuple[float, str]
) -> Figure:
    """Front speed along the track above, the terrain below.

    The whole track at the left, and the part with recordings enlarged at the right where it is short.

    Parameters
    ----------
    recordings : Recordings
    title : str
    draw : callable
        Draws the speeds in a panel.
    top : float
        Upper end of the speed axis [m/s].
    start : float and str
        Where the track is shown from [m], and what is said of the release.
    """
    shown = windows(recordings, start[0])
    figure = new_figure(5.7, title)
    panels = _panels(figure, len(shown))
    for column, (low, high) in enumerate(shown):
        in_detail = column == len(shown) - 1
        speed, profile = panels[:, column]
        draw(speed)
        if in_detail:
            _readings(speed, recordings)
        _runouts(speed, recordings)
        terrain_profile(profile, recordings, (low, high), named=in_detail)
        _reference(speed, profile, recordings)
        speed.set_xlim(low, high)
    panels[0, 0].set_ylabel(f"front speed [{unit_text('m s-1')}]")
    panels[0, 0].set_ylim(0, top)
    panels[1, 0].set_ylabel("elevation [m]")
    panels[1, -1].set_xlabel("s, the part with recordings [m]")
    panels[1, 0].set_xlabel(f"s [m], {start[1]}")
    legend_below(figure, panels[0], columns=2)
    return figure


def _panels(figure: Figure, n: int) -> Any:
    """Speed above terrain, (2, n) panels; in a narrow figure one pair below the other."""
    layout: dict[str, Any] = {"height_ratios": [2.1, 1]}
    if not is_narrow() or n == 1:
        return figure.subplots(2, n, sharex="col", sharey="row", squeeze=False, gridspec_kw=layout)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, 1.75 * height)
    layout["height_ratios"] = n * [2.1, 1.2]
    panels = figure.subplots(2 * n, 1, squeeze=False, gridspec_kw=layout)[:, 0].reshape(n, 2).T
    for column in range(n):
        panels[1, column].sharex(panels[0, column])
        panels[0, column].tick_params(labelbottom=False)
        if column:
            panels[0, column].sharey(panels[0, 0])
    notes_of(figure).stacked.append(list(panels[0]))
    return panels


def highest_recorded(recordings: Recordings) -> list[float]:
    """The highest recorded speed with its error [m/s]; empty where none is recorded."""
    of_speed = [column for column, _, _ in recordings.placed()]
    recorded = (recordings.values + recordings.reading_sd)[:, of_speed]
    finite = recorded[np.isfinite(recorded)]
    return [float(finite.max())] if len(finite) else []


def windows(recordings: Recordings, release: float) -> list[tuple[float, float]]:
    """Stretches of the track to show: all of it, and the one with recordings if that is short."""
    length = recordings.length_m
    whole = (min(release, length), length)
    places = [s for _, sensor, _ in recordings.placed() for s in (sensor.s_from_m, sensor.s_to_m)]
    for column, sensor in enumerate(recordings.sensors):
        if sensor.is_runout:
            places += recordings.values[recordings.observed[:, column], column].tolist()
    if not places:
        return [whole]
    low, high = max(whole[0], min(places) - 0.03 * length), min(length, max(places) + 0.03 * length)
    return [whole, (low, high)] if high - low < _ZOOM_BELOW * (length - whole[0]) else [whole]


def _readings(axes: Axes, recordings: Recordings) -> None:
    """Each reading with its error; spread sideways in order, or else they hide each other."""
    sd = recordings.reading_sd
    placed = recordings.placed()
    half = _half_width([middle for _, _, middle in placed], recordings.length_m)
    label: str | None = "recorded, with its error (spread sideways)"
    for column, sensor, middle in placed:
        rows = recordings.observed[:, column]
        values, errors = recordings.values[rows, column], sd[rows, column]
        if len(values) == 0:
            continue
        rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
        x = middle + half * (2 * (rank + 0.5) / len(values) - 1)
        if sensor.is_span:
            axes.hlines(values, sensor.s_from_m, sensor.s_to_m, color=GREY, linewidth=0.4, alpha=0.6)
        axes.errorbar(
            x, values, errors, label=label, fmt="o", color=GREY, markersize=2.4, elinewidth=0.6, clip_on=False
        )
        label = None
        events = [recordings.event_ids[k] for k in np.flatnonzero(rows)]
        told = [
            f"{event}, {sensor.id}: {value:.1f} ± {error:.1f} m/s"
            for event, value, error in zip(events, values, errors, strict=True)
        ]
        mark(axes, x, values, told, events)


def _half_width(places: list[float], length: float) -> float:
    """Half of the width that the points of one sensor are spread over [m]."""
    gaps = np.diff(np.unique(places))
    return float(min([0.016 * length, *(0.4 * gaps)]))


def _runouts(axes: Axes, recordings: Recordings) -> None:
    """Rug of the recorded runouts at the foot of the panel."""
    label = "recorded runouts"
    for column, sensor in enumerate(recordings.sensors):
        values = recordings.values[recordings.observed[:, column], column]
        if sensor.is_runout and len(values):
            foot = axes.get_xaxis_transform()
            axes.vlines(values, 0, 0.045, transform=foot, color=RECORDED, linewidth=1.2, label=label)
            label = "_not in the legend"
            events = [recordings.event_ids[k] for k in np.flatnonzero(recordings.observed[:, column])]
            told = [
                f"{event}, {sensor.id}: s = {value:.0f} m"
                for event, value in zip(events, values, strict=True)
            ]
            mark(axes, values, 0.0 * values, told, events)


def terrain_profile(axes: Axes, recordings: Recordings, window: tuple[float, float], *, named: bool) -> None:
    """Terrain with the sensors on it; spans as thick lines."""
    s_m, z_m = recordings.track_s_m, recordings.track_z_m
    height = float(np.ptp(z_m)) or 1.0
    axes.fill_between(s_m, z_m, z_m.min() - 0.08 * height, color="#ececec", linewidth=0)
    axes.plot(s_m, z_m, color=INK, linewidth=1.0)
    for _, sensor, middle in recordings.placed():
        if sensor.is_span:
            span = np.linspace(sensor.s_from_m, sensor.s_to_m, 20)
            axes.plot(span, np.interp(span, s_m, z_m), color=INK, linewidth=3.5, solid_capstyle="butt")
        axes.plot(middle, float(np.interp(middle, s_m, z_m)), marker="o", markersize=3.5, color=INK)
    if named:
        _names(axes, recordings, window)
    axes.set_ylim(z_m.min() - 0.08 * height, z_m.max() + 0.05 * height)


def _names(axes: Axes, recordings: Recordings, window: tuple[float, float]) -> None:
    """Names of the sensors above the panel, moved apart where they would overlap."""
    placed = recordings.placed()
    placed = placed[:: -(-len(placed) // _MAX_NAMED) or 1]
    gap = 0.045 * (window[1] - window[0])
    middles = spread(np.array([middle for _, _, middle in placed]), gap)
    if len(middles):  # moved apart, but not out of the window
        middles = middles + max(window[0] - middles.min(), 0.0)
        middles = middles - max(middles.max() - window[1], 0.0)
    for (_, sensor, middle), x in zip(placed, middles, strict=True):
        z = recordings.elevation(middle)
        axes.annotate(
            figure_text(sensor.id, 14),
            (middle, z),
            (float(x), 1.02),
            textcoords=axes.get_xaxis_transform(),
            rotation=90,
            ha="center",
            va="bottom",
            fontsize=7.5,
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkB": 3},
        )


def _reference(speed: Axes, profile: Axes, recordings: Recordings) -> None:
    """Mark the zero that runouts are reported from, such as the crown of a dam."""
    reference = recordings.reference_s_m
    if reference is None:
        return
    label = f"reference (zero of reported runouts), s = {reference:.0f} m"
    speed.axvline(reference, color=GREY, linewidth=0.9, linestyle="--", label=label)
    profile.axvline(reference, color=GREY, linewidth=0.9, linestyle="--")
