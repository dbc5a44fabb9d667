"""Whether places of readings in their predictions are spread evenly."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from skred.report.explore.figures import figures_of, quietly
from skred.report.explore.panel import Panel
from skred.report.explore.plots.loo_pit import mark_readings


def pit_panel(title: str, events: list[str], places: ArrayLike, note: str = "") -> Panel:
    """Places from 0 to 1 by arviz-plots, each reading a point on the line.

    Parameters
    ----------
    title : str
    events : list of str
        The event of each reading.
    places : (n,) array
    note : str
    """
    import arviz_plots as azp

    values = np.asarray(places, dtype=float)
    tree = xr.DataTree.from_dict({"pit": xr.Dataset({"reading": ("of", values)})})
    with quietly():
        collection = azp.plot_ecdf_pit(tree, group="pit", sample_dims=["of"], backend="bokeh")
    made, line = figures_of(collection)["reading"], collection.viz["ecdf_lines"]["reading"].item()
    mark_readings(made, line, values, events)
    return Panel(title, made, note=note)
