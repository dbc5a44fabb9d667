"""A statistic of recordings against that of simulated ones."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from skred.report.explore.figures import CHOSEN, figures_of, quietly, styled
from skred.report.explore.panel import NotShownError, Panel

HOW = "Line: simulated. Dot: the recordings; far to the right of the line they are not what chance makes."
"""How to read it."""

_FEWEST = 10
"""Simulated values below which there is no distribution to look at."""


def statistic_panel(title: str, label: str, simulated: ArrayLike, recorded: float) -> Panel:
    """Simulated values as a histogram and the recorded one as a point, by arviz-plots.

    Parameters
    ----------
    title, label : str
    simulated : (n,) array
        What is not finite is left out.
    recorded : float

    Raises
    ------
    NotShownError
        If there are too few values, or all are the same.
    """
    import arviz_plots as azp

    values = np.asarray(simulated, dtype=float)
    values = values[np.isfinite(values)]
    if len(values) < _FEWEST or np.ptp(values) == 0.0 or not np.isfinite(recorded):
        raise NotShownError("too few simulated values to draw their distribution")
    drawn = xr.Dataset(
        {"value": (("chain", "draw", "of"), values[None, :, None])},
        coords={"chain": [0], "draw": np.arange(len(values))},
    )
    observed = xr.Dataset({"value": ("of", np.array([recorded]))})
    tree = xr.DataTree.from_dict({"posterior_predictive": drawn, "observed_data": observed})
    with quietly():
        collection = azp.plot_ppc_tstat(
            tree, t_stat="mean", kind="hist", backend="bokeh", visuals={"remove_axis": False}
        )
    made = figures_of(collection)["value"]
    made.xaxis.axis_label, made.yaxis.axis_label = label, "density of the simulated"
    dot = collection.viz["observed_tstat"]["value"].item().glyph
    dot.size, dot.fill_color, dot.line_color = 11, CHOSEN, CHOSEN
    note = f"{len(values)} simulated."
    return Panel(title, styled(made, height=300, title=""), note=note)
