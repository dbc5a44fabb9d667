"""Front speed along the track, event by event, with the recordings on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.layouts import column
from bokeh.models import BoxAnnotation, CDSView, ColumnDataSource, IndexFilter
from markupsafe import Markup
from numpy.typing import NDArray

from skred.arrays import FloatArray
from skred.campaign import Status
from skred.dashboard.fronts import EventSpeeds, event_speeds
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.figures import (
    BLUE,
    CHOSEN,
    DRAWS_FILTER,
    EVENT,
    chosen_stands_out,
    legend_above,
    new_figure,
    points,
    spread_out,
)
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run, shown
from skred.report.shared.recordings import Recordings
from skred.report.shared.style import GREY

Curve = NDArray[np.float32]
_MOST_EDGES = 100
_CHOICE = Markup(
    '<label class="draws">Draws of the chosen event: '
    '<input type="range" min="0" max="{0}" value="0" data-draws="{1}" aria-label="which draw"> '
    "<output>all {0}</output></label>"
)


def speed_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """Medians of all events, the draws of the chosen one, recordings; and the track below."""
    recordings = run.recordings
    if recordings is None:
        raise NotShownError("this run does not say what was recorded, and on which track")
    speeds = event_speeds(run)
    made = new_figure("place along the track s [m]", "front speed [m/s]", height=430)
    _medians(made, speeds, recordings)
    _draws(made, speeds, recordings, run.key)
    _recorded(made, recordings)
    legend_above(made)
    note = "Lines: the median of each event's draws. Dots: what was recorded; runouts lie on the axis."
    if not speeds.own:
        note += " This is a pooled run: events of the same release move alike, as the path's mean front."
    choice = _CHOICE.format(len(speeds.speed), run.key)
    profile = new_figure("place along the track s [m]", "elevation [m]", height=200, x_range=made.x_range)
    _track(profile, recordings)
    both = column(made, profile, sizing_mode="stretch_width")
    return [Panel("Front speed of each event, above the track", both, html=str(choice), note=note, wide=True)]


def _medians(made: Any, speeds: EventSpeeds, recordings: Recordings) -> None:
    events = [shown(one, 60) for one in recordings.event_ids]
    xs, ys = _curves(speeds.s_m, np.median(speeds.speed, axis=0))
    source = ColumnDataSource({"xs": xs, "ys": ys, EVENT: events})
    lines = made.multi_line(
        "xs", "ys", source=source, color=BLUE, alpha=0.45, line_width=1.3, legend_label="median of an event"
    )
    chosen_stands_out(made, lines, line=True)


def _curves(s_m: FloatArray, speed: FloatArray) -> tuple[list[Curve], list[Curve]]:
    """Places and speeds of each front from where it starts to where it stops, (n, n_edges) to lists of n."""
    xs, ys = [], []
    for one in speed:
        moving = np.flatnonzero(one > 0.0)
        first, last = (moving[0], moving[-1]) if len(moving) else (0, 0)
        at = np.arange(max(first - 1, 0), min(last + 2, len(one)))
        kept = at[spread_out(at, _MOST_EDGES)]
        xs.append(s_m[kept].astype(np.float32))
        ys.append(one[kept].astype(np.float32))
    return xs, ys


def _draws(made: Any, speeds: EventSpeeds, recordings: Recordings, key: str) -> None:
    """Draws of all events, of which the page shows those of the chosen one."""
    n_draws, n_events, n_edges = speeds.speed.shape
    events = [shown(one, 60) for one in recordings.event_ids]
    xs, ys = _curves(speeds.s_m, speeds.speed.reshape(n_draws * n_events, n_edges))
    source = ColumnDataSource(
        {"xs": xs, "ys": ys, "of": events * n_draws, "draw": np.repeat(np.arange(n_draws), n_events)}
    )
    view = CDSView(filter=IndexFilter(indices=[], name=DRAWS_FILTER, tags=[key]))
    made.multi_line(
        "xs", "ys", source=source, view=view, color=CHOSEN, alpha=0.5, line_width=1.0, level="underlay"
    )


def _recorded(made: Any, recordings: Recordings) -> None:
    """Readings at the middles of their sensors; a front that did not come reads 0."""
    rows: list[tuple[float, float, str, str, str]] = []
    for at, sensor in enumerate(recordings.sensors):
        for number, event in enumerate(recordings.event_ids):
            status = recordings.status[number, at]
            value = recordings.values[number, at]
            name = shown(sensor.id, 30)
            middle = 0.5 * (sensor.s_from_m + sensor.s_to_m)
            if status == Status.OBSERVED and sensor.is_runout:
                rows.append((value, 0.0, shown(event, 60), name, f"stopped at {value:.0f} m"))
            elif status == Status.OBSERVED:
                rows.append((middle, value, shown(event, 60), name, f"{value:.1f} m/s"))
            elif status == Status.NOT_REACHED and not sensor.is_runout:
                rows.append((middle, 0.0, shown(event, 60), name, "not reached"))
    if rows:
        x, y, events, sensors, told = zip(*rows, strict=True)
        data = {"x": x, "y": y, "sensor": sensors, "told": told}
        tips = [("sensor", "@sensor"), ("recorded", "@told")]
        points(made, data, events, colour="#222222", size=6, legend="recorded", tips=tips)


def _track(made: Any, recordings: Recordings) -> None:
    made.line(recordings.track_s_m, recordings.track_z_m, color="#222222", line_width=1.5)
    for _, sensor, _ in recordings.placed():
        if sensor.is_span:
            made.add_layout(
                BoxAnnotation(left=sensor.s_from_m, right=sensor.s_to_m, fill_color=BLUE, fill_alpha=0.15)
            )
    placed = recordings.placed()
    if placed:
        middles = [middle for _, _, middle in placed]
        heights = [recordings.elevation(middle) for middle in middles]
        names = [shown(sensor.id, 12) for _, sensor, _ in placed]
        source = ColumnDataSource({"x": middles, "y": heights, "name": names})
        made.scatter("x", "y", source=source, size=8, color=BLUE, line_color="white")
        if len(placed) <= 15:
            made.text("x", "y", text="name", source=source, x_offset=5, y_offset=-6, text_color=GREY,
                      text_font_size="12px")  # fmt: skip
