"""The force that a law leaves out, along the track."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.layouts import column
from bokeh.models import BoxAnnotation, Span

from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.diagnosis.words import stretch_in, title_of
from skred.report.explore.figures import BLUE, CHOSEN, legend_above, new_figure
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run, shown
from skred.report.shared import document as doc
from skred.report.shared.numbers import is_number
from skred.report.shared.style import GREY


def force_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """The model discrepancy with its band, where avalanches come, and what was added."""
    force = run.group("force")
    s, mean, low, high = (force[name].values.astype(float) for name in ("s", "mean", "low", "high"))
    of_fast = doc.get(run.document, "report", "force", "nil_at_typical_speed") is True
    what = "missing retardation of a fast front [m/s²]" if of_fast else "missing retardation [m/s²]"
    made = new_figure("place along the track s [m]", what, height=380)
    made.varea(s, low, high, color=BLUE, fill_alpha=0.18, legend_label="90 %, the whole profile")
    made.line(s, mean, color=BLUE, line_width=2, legend_label="a force in no list")
    made.add_layout(Span(location=0, dimension="width", line_color=GREY))
    for mechanism in doc.listed(run.document, "mechanisms"):
        _stretch(made, mechanism)
    said = _added(run)
    if of_fast:
        said.append(
            "The force is that on a front that is faster than most by the spread of fronts there;"
            " at the typical speed it is nil."
        )
    said.append("Below: how many avalanches come that far, and the places of the sensors (blue).")
    legend_above(made)
    come = new_figure("place along the track s [m]", "share that comes [-]", height=200,
                      x_range=made.x_range)  # fmt: skip
    come.varea(s, np.zeros(len(s)), force["covered"].values, color=GREY, fill_alpha=0.3)
    _sensors(come, run)
    both = column(made, come, sizing_mode="stretch_width")
    return [Panel("What a retardation in no list would have to be", both, note=" ".join(said), wide=True)]


def _added(run: Run) -> list[str]:
    """What was added, in sentences: orange is only what acts on a stretch."""
    placed, said = list[str](), list[str]()
    for one in doc.listed(run.document, "mechanisms"):
        title = shown(title_of(run.document, str(doc.get(one, "id"))), 80)
        sensor = doc.get(one, "sensor")
        if stretch_in(doc.get(one, "location")) is not None:
            placed.append(title)
        elif sensor:
            said.append(f"Not drawn: {title}, added to the readings of {shown(sensor, 30)}.")
        else:
            said.append(f"Not drawn: {title}, added along the track.")
    if placed:
        said.insert(0, f"Orange: where {' and '.join(placed)} was added.")
    if doc.get(run.document, "profile"):
        said.append("No mechanism of the list was added, but this force itself (blue).")
    return said or ["Nothing was added."]


def _stretch(made: Any, mechanism: Any) -> None:
    """Where a mechanism was added; with its strength as height where that is a retardation."""
    stretch = stretch_in(doc.get(mechanism, "location"))
    if stretch is None:
        return
    mean, unit = (doc.get(mechanism, "strength", key) for key in ("mean", "unit"))
    if is_number(mean) and unit == "m s-2":
        made.quad(left=stretch[0], right=stretch[1], bottom=0.0, top=mean, color=CHOSEN, fill_alpha=0.15,
                  legend_label="added")  # fmt: skip
    else:
        box = BoxAnnotation(left=stretch[0], right=stretch[1], fill_color=CHOSEN, fill_alpha=0.13)
        made.add_layout(box)


def _sensors(made: Any, run: Run) -> None:
    recordings = run.recordings
    for _, _, middle in recordings.placed() if recordings is not None else ():
        made.add_layout(Span(location=middle, dimension="height", line_color=BLUE, line_width=1.5))
