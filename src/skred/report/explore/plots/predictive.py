"""Readings beside what the run predicts of them, sensor by sensor and avalanche by avalanche."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import GlyphRenderer

from skred.report.explore.figures import BLUE, figures_of, points, quietly, spread_out, styled
from skred.report.explore.panel import Panel
from skred.report.explore.plots.pareto_k import name_events
from skred.report.explore.run import Run, ids_of

HOW = (
    "Black: recorded. Lines and bars: what the run predicts. The black line should look like one of the blue"
    " ones, and nine in ten thin bars should hold their dot."
)
"""How to read it."""

_PREDICTED, _POINTS = 40, 160
"""Predicted distributions of a sensor, and points of each."""
_MOST_BY_EVENT = 200


def predictive_panels(run: Run) -> list[Panel]:
    """For each sensor distributions, and intervals by event; both by arviz-plots."""
    panels = []
    for name in run.observed_names:
        label = run.sensor_label(name)
        note = "Predicted: a new avalanche from the release of each event." if run.is_ours else ""
        note += " Runouts are lengths s along the track." if _is_runout(run, name) else ""
        panels.append(Panel(f"{label}: all events", _distribution(run, name, label), note=note))
        if run.group("observed_data")[name].size <= _MOST_BY_EVENT:
            panels.append(Panel(f"{label}: by event", _intervals(run, name, label)))
    return panels


def _is_runout(run: Run, name: str) -> bool:
    known = run.recordings.sensors if run.recordings is not None else ()
    return any(sensor.is_runout and sensor.id == name for sensor in known)


def _distribution(run: Run, name: str, label: str) -> Any:
    import arviz_plots as azp

    with quietly():
        collection = azp.plot_ppc_dist(
            run.tree,
            var_names=[name],
            num_samples=_PREDICTED,
            kind="ecdf",
            backend="bokeh",
            visuals={"remove_axis": False},
        )
    made = figures_of(collection)[name]
    recorded = _renderers(collection.viz["observed_dist"][name])
    _as_one(made, recorded)
    for line in recorded:
        line.glyph.line_color, line.glyph.line_width, line.glyph.line_dash = "#222222", 2, "solid"
    made.xaxis.axis_label, made.yaxis.axis_label = label, "share that is smaller [-]"
    styled(made, height=280, title="")
    observed = run.group("observed_data")[name]
    values = observed.values.ravel()
    share = np.searchsorted(np.sort(values), values, side="right") / len(values)
    data = {"x": values, "y": share}
    points(made, data, ids_of(observed), colour="#222222", size=6, tips=[("recorded", "@x{0.0}")])
    return made


def _as_one(made: Any, others: list[GlyphRenderer]) -> None:
    """The many lines of predictions as one renderer: a page with thousands of renderers opens slowly."""
    lines = [one for one in made.renderers if isinstance(one, GlyphRenderer) and one not in others]
    lines = [one for one in lines if {"x", "y"} <= set(one.data_source.data)]
    xs, ys = [], []
    for one in lines:
        x, y = (np.asarray(one.data_source.data[key], dtype=np.float32) for key in ("x", "y"))
        x, y = _steps(x, y)
        xs.append(x)
        ys.append(y)
    made.renderers = [one for one in made.renderers if one not in lines]
    made.multi_line(xs, ys, color=BLUE, alpha=0.22, line_width=1.0, level="underlay")


def _steps(x: Any, y: Any) -> tuple[Any, Any]:
    """Corners of a line of steps: of few readings these are far fewer than its points."""
    rises = np.flatnonzero(np.diff(y)) + 1
    if 2 * len(rises) > _POINTS:
        kept = spread_out(x, _POINTS)
        return x[kept], y[kept]
    corners = np.repeat(x[rises], 2)
    heights = np.column_stack([y[rises - 1], y[rises]]).ravel()
    return np.concatenate([x[:1], corners, x[-1:]]), np.concatenate([y[:1], heights, y[-1:]])


def _intervals(run: Run, name: str, label: str) -> Any:
    import arviz_plots as azp

    observed = run.group("observed_data")[name]
    events = ids_of(observed)
    with quietly():
        collection = azp.plot_ppc_interval(
            run.tree, var_names=[name], point_estimate="median", ci_kind="eti", ci_probs=(0.5, 0.9),
            backend="bokeh",
        )  # fmt: skip
    made = figures_of(collection)[name]
    made.xaxis.axis_label, made.yaxis.axis_label = "event", label
    styled(made, height=330, title="")
    x, y = np.arange(len(events), dtype=float), observed.values.ravel()
    for marks in _renderers(collection.viz["observed_markers"][name]):
        marks.visible = False  # drawn again, one source of all events
    points(made, {"x": x, "y": y}, events, colour="#222222", tips=[("recorded", "@y{0.0}")])
    name_events(made, events)
    return made


def _renderers(marks: Any) -> list[GlyphRenderer]:
    return [one for one in np.ravel(marks.values) if isinstance(one, GlyphRenderer)]
