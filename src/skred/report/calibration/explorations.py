"""What can be explored of a calibration: the plots of ArviZ of what its figures draw.

The population and the speed along the track have none: ArviZ has no plot of the distribution of new
avalanches over two strengths, and none along a track.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from skred.report.shared.drawing import Exploration
from skred.report.shared.labels import name_text, symbol_text, unit_text
from skred.report.shared.law import law_of
from skred.report.shared.recordings import recordings_of

if TYPE_CHECKING:
    import xarray as xr

    from skred.report.explore.panel import Panel
    from skred.report.explore.run import Run


def explorations(tree: xr.DataTree) -> dict[str, Callable[[], Exploration | None]]:
    """Makers of explorations by the name of the figure.

    Parameters
    ----------
    tree : DataTree
        The content of ``posterior.nc``.
    """
    from skred.report.explore.exploration import Plot, exploration
    from skred.report.explore.plots import event_forest, pair, predictive, prior_posterior, rank, trace
    from skred.report.explore.run import Run, numbered

    run = Run("r1", law_of(tree).title, "calibration", "", tree.map_over_datasets(numbered))
    chains = (
        Plot("plot_trace", trace.HOW, partial(trace.trace_panels, run)),
        Plot("plot_rank", rank.HOW, partial(rank.rank_panels, run)),
    )
    joint = Plot("plot_pair", pair.HOW, partial(pair.pair_panels, run))
    marginals = Plot("plot_prior_posterior", prior_posterior.HOW, partial(prior_posterior.prior_panels, run))
    predicted = Plot(
        "plot_ppc_dist and plot_ppc_interval", predictive.HOW, partial(predictive.predictive_panels, run)
    )
    events = Plot("plot_forest", event_forest.HOW, partial(_of_events, run))
    return {
        "trace": partial(exploration, *chains),
        "joint": partial(exploration, joint),
        "marginals": partial(exploration, marginals),
        "predictive": partial(exploration, predicted),
        "new_avalanche": partial(exploration, predicted),
        "events": partial(exploration, events),
    }


def _of_events(run: Run) -> list[Panel]:
    """A forest of each strength that every avalanche has of its own."""
    from skred.report.explore.plots.event_forest import event_forest_panel

    ids = list(recordings_of(run.tree).event_ids)
    draws = run.group("event_posterior").assign_coords(event=ids)
    return [
        event_forest_panel(
            draws[one.name], f"{name_text(one.name)} {symbol_text(one.symbol)} [{unit_text(one.unit)}]"
        )
        for one in law_of(run.tree).strengths
    ]
