"""What each event has of its own: a forest of events."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from bokeh.models import DataRange1d, LogScale, LogTicker

from skred.report.explore.figures import BLUE, apart, points, quietly, styled
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import shown

HOW = "Dot: median; thick line: 50 %; thin line: 90 %."
"""How to read it."""

MOST_EVENTS = 60
"""Rows of a forest that can be told apart."""
_LOG_BEYOND = 20.0
_WIDTHS = {"twig": 1.2, "trunk": 4.0}
"""Of the line of 90 %, and of that of 50 %, in pixels."""


def event_forest_panel(draws: xr.DataArray, label: str) -> Panel:
    """Median, 50 and 90 % of each event by arviz-plots.

    Parameters
    ----------
    draws : (chain, draw, event) DataArray
        With ids as coordinates.
    label : str
        Name and unit.

    Raises
    ------
    NotShownError
        If a draw is no number.
    """
    import arviz_plots as azp

    if not np.isfinite(draws.values).all():
        raise NotShownError("not all draws are numbers")
    n = draws.sizes["event"]
    first = draws.isel(event=slice(MOST_EVENTS))
    events = [shown(one, 60) for one in first["event"].values]
    # ArviZ keeps a text for each row: ids of strangers are put where they are escaped.
    numbered = first.assign_coords(event=np.arange(len(events)))
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset({"strength": numbered})})
    with quietly():
        collection = azp.plot_forest(
            tree, combined=True, point_estimate="median", ci_kind="eti", ci_probs=(0.5, 0.9),
            labels=["event"], backend="bokeh",
        )  # fmt: skip
    made = collection.viz["plot"].sel(column="forest").item()
    apart(made)
    x, y = _with_few_renderers(made, collection)
    made.xaxis.axis_label, made.yaxis.axis_label = label, "event"
    styled(made, height=110 + 17 * len(events), title="")
    points(made, {"x": x, "y": y}, events, tips=[("median", "@x{0.0000}")])
    _logarithmic(made, float(first.quantile(0.05)), float(first.quantile(0.95)))
    axis = made.yaxis[0]
    axis.visible, axis.ticker = True, sorted(y.tolist())
    axis.major_label_overrides = {at: event[:14] for at, event in zip(y.tolist(), events, strict=True)}
    note = f"The first {MOST_EVENTS} of {n} events." if n > MOST_EVENTS else ""
    return Panel(label, made, note=note)


def _with_few_renderers(made: Any, collection: Any) -> tuple[np.ndarray, np.ndarray]:
    """Lines of all events as one renderer each: ArviZ draws three for every event; where the medians are."""
    made.renderers = []
    for visual, width in _WIDTHS.items():
        ends = [one.data_source.data for one in collection.viz[visual]["strength"].values]
        low, high, at = (
            np.array([end[k][place] for end in ends]) for k, place in (("x", 0), ("x", -1), ("y", 0))
        )
        made.segment(low, at, high, at, color=BLUE, line_width=width)
    medians = [one.data_source.data for one in collection.viz["point_estimate"]["strength"].values]
    x, y = (np.array([float(one[key][0]) for one in medians]) for key in ("x", "y"))
    return x, y


def _logarithmic(made: Any, low: float, high: float) -> None:
    """A logarithmic axis where strengths span much."""
    if low > 0.0 and high / low > _LOG_BEYOND:
        made.x_scale, made.x_range = LogScale(), DataRange1d()
        made.xaxis.ticker = made.xgrid.ticker = LogTicker(num_minor_ticks=0)
