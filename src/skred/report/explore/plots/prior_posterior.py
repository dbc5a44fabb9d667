"""What the recordings taught: prior against posterior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from skred.report.explore.figures import figures_of, legend_above, quietly, slim, styled, thin
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run

HOW = "Grey: before the recordings. Blue: after them. Where both agree, the recordings taught nothing."
"""How to read it."""

_POINTS = 250
"""Of a curve: more cannot be seen, and every one is in the page."""


def prior_panels(run: Run, chosen: Sequence[str] = ()) -> list[Panel]:
    """Densities of prior and posterior of each parameter, by arviz-plots."""
    import arviz_plots as azp

    posterior = run.parameters(chosen)
    prior = run.parameters(chosen, group="prior")
    names = [
        name
        for name in posterior.data_vars
        if name in prior and np.isfinite(posterior[name]).any() and np.isfinite(prior[name]).any()
    ]
    if not names:
        raise NotShownError("the prior of this run has none of the parameters")
    tree = xr.DataTree.from_dict({"posterior": posterior[names], "prior": prior[names]})
    with quietly():
        collection = azp.plot_prior_posterior(tree, backend="bokeh")
        made = figures_of(collection)
    panels = []
    for name, figure in made.items():
        _named(collection, str(name))
        label = str(posterior[name].attrs["label"])
        figure.xaxis.axis_label = str(posterior[name].attrs["axis"])
        figure.yaxis.axis_label = "density"
        figure.yaxis.ticker = []
        styled(figure, height=240, title="")
        _around(figure, posterior[name], prior[name])
        legend_above(figure)
        panels.append(Panel(label, figure))
    return panels


def _named(collection: object, name: str) -> None:
    """A legend in the figure itself; that of the collection stands in a figure of its own."""
    from bokeh.models import Legend, LegendItem

    marks = collection.viz["dist"][name]  # type: ignore[attr-defined]
    figure = collection.viz["plot"][name].item()  # type: ignore[attr-defined]
    items = []
    for group in map(str, marks["group"].values):
        renderer = marks.sel(group=group).item()
        renderer.glyph.line_color = {"prior": "#767676", "posterior": "#0072B2"}.get(group, "#222222")
        renderer.glyph.line_width = 2
        thin(renderer.data_source, _POINTS)
        slim(renderer.data_source)
        items.append(LegendItem(label=group, renderers=[renderer]))
    figure.center = [one for one in figure.center if not isinstance(one, Legend)]
    figure.right = [one for one in figure.right if not isinstance(one, Legend)]
    figure.add_layout(Legend(items=items))


def _around(figure: object, draws: xr.DataArray, prior: xr.DataArray) -> None:
    """Look at where the posterior is: a wide prior would press it into a line; nor beyond what can be."""
    from bokeh.models import Range1d

    low, high = (float(v) for v in draws.quantile([0.001, 0.999]).values)
    room = 2.0 * (high - low) or abs(high) or 1.0
    least, most = (min(draws.min(), prior.min()), max(draws.max(), prior.max()))
    start, end = max(low - room, float(least)), min(high + room, float(most))
    start = max(0.0, start) if least >= 0.0 else start
    figure.x_range = Range1d(start, end)  # type: ignore[attr-defined]
