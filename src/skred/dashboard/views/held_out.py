"""Avalanches predicted from the others, before and after something was added."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.figures import new_figure, points
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run, shown
from skred.report.shared.labels import unit_text
from skred.report.shared.recordings import Recordings
from skred.report.shared.style import GREY

_WORDS = {"before": "base law", "after": "with what was added"}


def held_out_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """Predicted against recorded, speeds and runouts, before and after."""
    held, recordings = run.group("held_out"), run.recordings
    if recordings is None:
        raise NotShownError("this diagnosis does not say what was recorded")
    panels = []
    for runout, what, unit in ((False, "front speed", unit_text("m s-1")), (True, "runout s", "m")):
        columns = recordings.is_runout == runout
        if not (recordings.observed & columns).any():
            continue
        for when in map(str, held["when"].values):
            made = _figure(held.sel(when=when), recordings, columns, what, unit)
            panels.append(Panel(f"{what.capitalize()}: {_WORDS.get(when, when)}", made))
    return panels


def _figure(held: Any, recordings: Recordings, columns: Any, what: str, unit: str) -> Any:
    shown_ = recordings.observed & columns
    numbers, sensors = np.nonzero(shown_)
    mean, low, high = (
        held[name].transpose("event", "sensor").values[shown_] for name in ("mean", "low", "high")
    )
    recorded = recordings.values[shown_]
    made = new_figure(f"recorded {what} [{unit}]", f"predicted {what} [{unit}]", height=330)
    ends = [float(min(recorded.min(), np.nanmin(mean))), float(max(recorded.max(), np.nanmax(mean)))]
    made.line(ends, ends, color=GREY, line_dash="dashed")
    made.segment(recorded, low, recorded, high, color=GREY, line_alpha=0.35)
    data = {
        "x": recorded, "y": mean, "low": low, "high": high,
        "sensor": [shown(recordings.sensors[k].id, 30) for k in sensors],
    }  # fmt: skip
    tips = [
        ("sensor", "@sensor"), ("recorded", "@x{0.0}"), ("predicted", "@y{0.0}"),
        ("90 %", "@low{0.0} to @high{0.0}"),
    ]  # fmt: skip
    points(made, data, [shown(recordings.event_ids[k], 60) for k in numbers], tips=tips)
    return made
