"""The distribution of the draws of one number, and its chains."""

from __future__ import annotations

import numpy as np
import xarray as xr

from skred.report.explore.figures import figures_of, quietly, styled
from skred.report.explore.panel import NotShownError, Panel

HOW = "Dot: mean; line below the curve: 90 %, equal-tailed."
"""How to read it."""

_FEWEST = 10
"""Draws below which there is no distribution to look at."""


def draws_panel(draws: xr.DataArray, title: str, label: str) -> Panel:
    """Density of draws with their mean and interval, by arviz-plots.

    Parameters
    ----------
    draws : (chain, draw) DataArray
    title, label : str

    Raises
    ------
    NotShownError
        If there are too few draws, or all are the same.
    """
    import arviz_plots as azp

    values = np.asarray(draws.values, dtype=float)
    if values.size < _FEWEST or not np.isfinite(values).all() or np.ptp(values) == 0.0:
        raise NotShownError("too few draws to show their distribution")
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset({"value": draws})})
    with quietly():
        collection = azp.plot_dist(
            tree, backend="bokeh", ci_kind="eti", ci_prob=0.9, point_estimate="mean",
            visuals={"point_estimate_text": False, "remove_axis": False},
        )  # fmt: skip
    made = figures_of(collection)["value"]
    made.xaxis.axis_label, made.yaxis.axis_label = label, "density"
    collection.viz["dist"]["value"].item().glyph.line_width = 2
    collection.viz["credible_interval"]["value"].item().glyph.line_width = 3
    collection.viz["point_estimate"]["value"].item().glyph.size = 9
    return Panel(title, styled(made, height=280, title=""))
