"""Draws in their order, chain by chain."""

from __future__ import annotations

import xarray as xr

from skred.dashboard.figures import figures_of, quietly, spread_out, styled
from skred.dashboard.reading import Given
from skred.dashboard.run import Run
from skred.dashboard.view import Asked, Panel

MOST_DRAWS = 400
"""Draws of a chain that a trace shows."""


def trace_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """A trace for each parameter, by arviz-plots."""
    import arviz_plots as azp

    draws = run.parameters(asked.parameters)
    kept = spread_out(draws["draw"], MOST_DRAWS)
    tree = xr.DataTree.from_dict({"posterior": draws.isel(draw=kept)})
    with quietly():
        made = figures_of(azp.plot_trace(tree, backend="bokeh"))
    panels = []
    for name, figure in made.items():
        label = str(draws[name].attrs["label"])
        figure.xaxis.axis_label, figure.yaxis.axis_label = "draw", str(draws[name].attrs["axis"])
        panels.append(Panel(label, styled(figure, height=220, title="")))
    return panels
