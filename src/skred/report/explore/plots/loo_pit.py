"""Whether left-out readings fall where they were predicted: LOO-PIT by sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.report.explore.figures import figures_of, points, quietly, styled
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run, ids_of

HOW = (
    "Left-out readings should fall anywhere in their predictions with the same chance. A line far from zero"
    " means that predictions are biased, too narrow or too wide; below α, the p-value says that this is no"
    " chance."
)
"""How to read it."""


def loo_pit_panels(run: Run) -> list[Panel]:
    """LOO-PIT of each sensor by arviz-plots, each reading a point on the line."""
    import arviz_plots as azp
    import arviz_stats as azs

    tree = run.aligned
    names = [name for name in run.observed_names if _is_given(run, name)]
    if not names:
        raise NotShownError(
            "the likelihood of this run is not by sensor, and so leaving out does not tell one from another"
        )
    panels = []
    for name in names:
        with quietly():
            pit = azs.loo_pit(tree, var_names=[name])[name]
            collection = azp.plot_loo_pit(tree, var_names=[name], backend="bokeh")
        made, line = figures_of(collection)[name], collection.viz["ecdf_lines"][name].item()
        events = ids_of(run.group("observed_data")[name])
        mark_readings(made, line, np.asarray(pit.values, dtype=float).ravel(), events)
        panels.append(Panel(run.sensor_label(name), made))
    return panels


def _is_given(run: Run, name: str) -> bool:
    likelihood = run.group("log_likelihood")
    return name in likelihood.data_vars or name in likelihood.coords


def mark_readings(made: Any, line: Any, pit: np.ndarray, events: list[str]) -> None:
    """Put each reading on the line of a plot of places in predictions.

    Parameters
    ----------
    made : bokeh figure
    line : GlyphRenderer
        The line of the plot.
    pit : (n,) array
        Places, 0 to 1.
    events : list of str
        The event of each.
    """
    made.xaxis.axis_label = "LOO-PIT: share of smaller predictions [-]"
    made.yaxis.axis_label = "difference from uniform [-]"
    styled(made, height=280, title="")
    x, y = (np.asarray(line.data_source.data[key], dtype=float) for key in ("x", "y"))
    step = np.clip(np.searchsorted(x, pit), 0, len(x) - 1)  # a step has the height of its right end
    points(made, {"x": pit, "y": y[step]}, events, size=6, tips=[("LOO-PIT", "@x{0.00}")])
