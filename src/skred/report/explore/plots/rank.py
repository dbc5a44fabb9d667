"""Ranks of the draws: whether all chains explore the same."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from skred.report.explore.figures import figures_of, quietly, styled, thin
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run

HOW = (
    "A line for each chain. Chains that explore the same stay close to zero; a p-value below α says that they"
    " do not, or that draws of a chain are much alike."
)
"""How to read it."""

_POINTS = 300
"""Of a line: more cannot be seen, and every one is in the page."""


def rank_panels(run: Run, chosen: Sequence[str] = ()) -> list[Panel]:
    """Differences of each chain's distribution of ranks from a uniform one, by arviz-plots.

    Raises
    ------
    NotShownError
        If there is only one chain.
    """
    import arviz_plots as azp

    draws = run.parameters(chosen)
    if draws.sizes.get("chain", 0) < 2:
        raise NotShownError("there is one chain only, and ranks compare chains")
    tree = xr.DataTree.from_dict({"posterior": draws})
    with quietly():
        made = figures_of(azp.plot_rank(tree, backend="bokeh", visuals={"remove_axis": False}))
    panels = []
    for name, figure in made.items():
        for renderer in figure.renderers:
            thin(renderer.data_source, _POINTS)
        figure.xaxis.axis_label = "rank of the draw, as a share [-]"
        figure.yaxis.axis_label = "difference [-]"
        panels.append(Panel(str(draws[name].attrs["label"]), styled(figure, height=230, title="")))
    return panels
