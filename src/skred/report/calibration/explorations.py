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
    from skred.report.explore.exploration import exploration
    from skred.report.explore.plots.pair import pair_panels
    from skred.report.explore.plots.predictive import predictive_panels
    from skred.report.explore.plots.prior_posterior import prior_panels
    from skred.report.explore.plots.rank import rank_panels
    from skred.report.explore.plots.trace import trace_panels
    from skred.report.explore.run import Run

    run = Run("r1", law_of(tree).title, "calibration", "", tree)
    predicted = partial(exploration, "plot_ppc_dist and plot_ppc_interval", partial(predictive_panels, run))
    return {
        "trace": partial(
            exploration, "plot_trace and plot_rank", partial(trace_panels, run), partial(rank_panels, run)
        ),
        "joint": partial(exploration, "plot_pair", partial(pair_panels, run)),
        "marginals": partial(exploration, "plot_prior_posterior", partial(prior_panels, run)),
        "predictive": predicted,
        "new_avalanche": predicted,
        "events": partial(exploration, "plot_forest", partial(_of_events, run)),
    }


def _of_events(run: Run) -> list[Panel]:
    """A forest of each strength that every avalanche has of its own."""
    from skred.report.explore.plots.event_forest import event_forest_panel

    draws = run.group("event_posterior")
    return [
        event_forest_panel(
            draws[one.name], f"{name_text(one.name)} {symbol_text(one.symbol)} [{unit_text(one.unit)}]"
        )
        for one in law_of(run.tree).strengths
    ]
