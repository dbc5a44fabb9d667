"""Draws in their order, chain by chain."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from skred.report.explore.figures import figures_of, quietly, spread_out, styled
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run

HOW = (
    "Draws in their order, a colour for each chain. Chains that mix well look alike, as noise without drift."
)
"""How to read it."""

MOST_DRAWS = 400
"""Draws of a chain that a trace shows."""


def trace_panels(run: Run, chosen: Sequence[str] = ()) -> list[Panel]:
    """A trace for each parameter, by arviz-plots."""
    import arviz_plots as azp

    draws = run.parameters(chosen)
    kept = spread_out(draws["draw"], MOST_DRAWS)
    tree = xr.DataTree.from_dict({"posterior": draws.isel(draw=kept)})
    with quietly():
        made = figures_of(azp.plot_trace(tree, backend="bokeh"))
    n = draws.sizes["draw"]
    note = f"{len(kept)} of the {n} draws of each chain." if len(kept) < n else ""
    panels = []
    for name, figure in made.items():
        label = str(draws[name].attrs["label"])
        figure.xaxis.axis_label, figure.yaxis.axis_label = "draw", str(draws[name].attrs["axis"])
        panels.append(Panel(label, styled(figure, height=220, title=""), note=note))
    return panels
