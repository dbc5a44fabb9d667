"""Parameters against each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from skred.report.explore.figures import apart, quietly, spread_out, styled
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run

HOW = (
    "Each dot is a draw. A narrow band says that the recordings fix a combination of both, not each by"
    " itself."
)
"""How to read it."""

MOST_PAIRED, MOST_DRAWS = 6, 250
"""Parameters, each of which gets a row and a column; draws of a chain."""


def pair_panels(run: Run, chosen: Sequence[str] = ()) -> list[Panel]:
    """The draws of each pair of parameters, by arviz-plots, each a panel of its own."""
    import arviz_plots as azp

    draws = run.parameters(chosen, most=MOST_PAIRED)
    names = [str(name) for name in draws.data_vars]
    kept = spread_out(draws["draw"], MOST_DRAWS)
    tree = xr.DataTree.from_dict({"posterior": draws[names].isel(draw=kept)})
    if len(names) < 2:
        return [Panel("One parameter only", html="<p>A pair needs two parameters.</p>", wide=True)]
    with quietly():
        grid = azp.plot_pair(tree, backend="bokeh", marginal=False).viz["plot"]
    n = draws.sizes["draw"]
    note = f"{len(kept)} of the {n} draws of each chain." if len(kept) < n else ""
    panels = []
    labels = [str(draws[name].attrs["label"]) for name in names]
    axes = [str(draws[name].attrs["axis"]) for name in names]
    for row, y in enumerate(labels):
        for column, x in enumerate(labels[:row]):
            cell = grid.isel(row_index=row, col_index=column)
            panels.append(Panel(f"{y} against {x}", _named(cell, axes[column], axes[row]), note=note))
    return panels


def _named(cell: Any, x: str, y: str) -> Any:
    figure = cell.item()
    figure.xaxis.axis_label, figure.yaxis.axis_label = x, y
    # In the grid of arviz-plots inner figures have no axes and share their ranges.
    apart(figure)
    for axis in figure.axis:
        axis.visible = True
        axis.major_label_text_font_size = "12px"
    return styled(figure, height=260, title="")
