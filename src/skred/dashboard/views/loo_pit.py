"""Whether left-out readings fall where they were predicted: LOO-PIT by sensor."""

from __future__ import annotations

import numpy as np

from skred.dashboard.figures import figures_of, points, quietly, styled
from skred.dashboard.reading import Given
from skred.dashboard.run import Run, ids_of
from skred.dashboard.view import Asked, NotShownError, Panel
from skred.report.shared.style import GREY


def loo_pit_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
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
            made = figures_of(azp.plot_loo_pit(tree, var_names=[name], backend="bokeh"))[name]
        _mark(made, np.asarray(pit.values, dtype=float).ravel(), ids_of(run.group("observed_data")[name]))
        panels.append(Panel(run.sensor_label(name), made))
    return panels


def _is_given(run: Run, name: str) -> bool:
    likelihood = run.group("log_likelihood")
    return name in likelihood.data_vars or name in likelihood.coords


def _mark(made: object, pit: np.ndarray, events: list[str]) -> None:
    """Put each reading on the line of the plot."""
    made.xaxis.axis_label = "LOO-PIT: share of smaller predictions [-]"  # type: ignore[attr-defined]
    made.yaxis.axis_label = "difference from uniform [-]"  # type: ignore[attr-defined]
    styled(made, height=280, title="")
    order, n = np.sort(pit), len(pit)
    at = np.concatenate([[0.0], np.repeat(order, 2), [1.0]])
    height = np.concatenate([[0.0], np.repeat(np.arange(n + 1) / n, 2)[1:-1], [1.0]])
    made.line(at, height - at, color=GREY, line_alpha=0.6)  # the plot's own line is on a coarse grid
    difference = np.searchsorted(order, pit, side="right") / n - pit
    points(made, {"x": pit, "y": difference}, events, size=6, tips=[("LOO-PIT", "@x{0.00}")])
