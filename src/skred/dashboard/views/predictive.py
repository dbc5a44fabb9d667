"""Readings beside what the run predicts of them, sensor by sensor and avalanche by avalanche."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import GlyphRenderer, Line
from numpy.typing import NDArray

from skred.dashboard.figures import BLUE, figures_of, points, quietly, spread_out, styled
from skred.dashboard.reading import Given
from skred.dashboard.run import Run, ids_of
from skred.dashboard.view import Asked, Panel
from skred.dashboard.views.pareto_k import name_events

FloatArray = NDArray[np.float64]
_PREDICTED, _POINTS = 40, 160
"""Predicted distributions of a sensor, and points of each."""
_MOST_BY_EVENT = 200


def predictive_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """For each sensor distributions, and intervals by event; both by arviz-plots."""
    panels = []
    for name in run.observed_names:
        label = run.sensor_label(name)
        panels.append(Panel(f"{label}: all events", _distribution(run, name, label)))
        if run.group("observed_data")[name].size <= _MOST_BY_EVENT:
            panels.append(Panel(f"{label}: by event", _intervals(run, name, label)))
    return panels


def _distribution(run: Run, name: str, label: str) -> Any:
    import arviz_plots as azp

    with quietly():
        collection = azp.plot_ppc_dist(
            run.tree, var_names=[name], num_samples=_PREDICTED, backend="bokeh", visuals={"observed_dist": False}
        )
    made = figures_of(collection)[name]
    _as_one(made)
    made.xaxis.axis_label, made.yaxis.axis_label = label, "density"
    made.yaxis.ticker = []
    styled(made, height=270, title="")
    observed = run.group("observed_data")[name]
    _kernel(made, observed.values.ravel())
    data = {"x": observed.values.ravel(), "y": np.zeros(observed.size)}
    points(made, data, ids_of(observed), colour="#222222", marker="circle", tips=[("recorded", "@x{0.0}")])
    return made


def _as_one(made: Any) -> None:
    """The many lines of a figure as one renderer: a page with thousands of renderers opens slowly."""
    lines = [one for one in made.renderers if isinstance(one, GlyphRenderer) and isinstance(one.glyph, Line)]
    xs, ys = [], []
    for one in lines:
        x, y = (np.asarray(one.data_source.data[key], dtype=np.float32) for key in ("x", "y"))
        kept = spread_out(x, _POINTS)
        xs.append(x[kept])
        ys.append(y[kept])
    made.renderers = [one for one in made.renderers if one not in lines]
    made.multi_line(xs, ys, color=BLUE, alpha=0.3, line_width=1.0)


def _kernel(made: Any, values: FloatArray) -> None:
    """The density of what was recorded, as of each prediction."""
    import arviz_stats as azs
    import xarray as xr

    if len(values) > 2 and np.ptp(values) > 0.0:
        kernel = azs.kde(xr.DataArray(values, dims="event"), dim="event")
        x, y = (kernel.sel(plot_axis=axis).values for axis in ("x", "y"))
        kept = spread_out(x, _POINTS)
        made.line(x[kept], y[kept], color="#222222", line_width=2)


def _intervals(run: Run, name: str, label: str) -> Any:
    import arviz_plots as azp

    observed = run.group("observed_data")[name]
    events = ids_of(observed)
    with quietly():
        collection = azp.plot_ppc_interval(run.tree, var_names=[name], backend="bokeh")
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

