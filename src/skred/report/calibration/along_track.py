"""Figure of the mean response's front speed along the track, with recordings and terrain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skred.report.shared.draws import chains_of
from skred.report.shared.labels import figure_text
from skred.report.shared.style import RECORDED, law_colours, styled
from skred.report.shared.track_panels import highest_recorded, placed_sensors, track_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.inference.pooled.problem import PooledProblem
    from skred.physics.law import Law

FloatArray = NDArray[np.float64]
MAX_DRAWS = 400


@styled
def along_track_figure(tree: xr.DataTree, law: Law, problem: PooledProblem) -> Figure:
    """Median and 50 and 90 % bands of the mean response's speed, and the terrain below."""
    release = float(np.median([event.release_s_m for event in problem.campaign.events]))
    speeds = _speeds(tree, law, problem, release)
    colour = law_colours([law.id])[law.id]

    def draw(axes: Axes) -> None:
        _bands(axes, problem.terrain.edge_s_m, speeds, colour)
        _means(axes, problem)

    title = f"Front speed along the track, and what was recorded\n{figure_text(law.title, 80)}"
    start = (release, _release_text(problem, release))
    return track_figure(problem, title, draw, top=_top(speeds, problem), start=start)


def _release_text(problem: PooledProblem, release: float) -> str:
    n_releases = len(problem.releases)
    which = f", the median of {n_releases} places" if n_releases > 1 else ""
    return f"release at s = {release:.0f} m{which}"


def _speeds(tree: xr.DataTree, law: Law, problem: PooledProblem, release: float) -> FloatArray:
    """Speeds of evenly chosen draws, (n_draws, n_edges)."""
    samples = {name: chains_of(tree, name).ravel() for name in law.parameter_names}
    size = len(samples[law.parameter_names[0]])
    chosen = np.unique(np.linspace(0, size - 1, min(size, MAX_DRAWS)).astype(int))
    rows = law.strength_rows({name: values[chosen] for name, values in samples.items()})
    return problem.speeds(law.mechanisms, rows, release)


def _top(speeds: FloatArray, problem: PooledProblem) -> float:
    """Upper end of the speed axis: everything is inside."""
    of_speed = [column for column, _, _ in placed_sensors(problem)]
    spread_of_mean = (problem.recorded_mean + np.sqrt(np.diagonal(problem.covariance)))[of_speed]
    finite = spread_of_mean[np.isfinite(spread_of_mean)].tolist()
    return 1.05 * max(
        float(np.quantile(speeds, 0.95, axis=0).max()), 1.0, *highest_recorded(problem), *finite
    )


def _bands(axes: Axes, s_m: FloatArray, speeds: FloatArray, colour: str) -> None:
    low, lower, median, upper, high = np.quantile(speeds, [0.05, 0.25, 0.5, 0.75, 0.95], axis=0)
    axes.fill_between(s_m, low, high, color=colour, alpha=0.22, linewidth=0, label="mean response, 90 %")
    axes.fill_between(s_m, lower, upper, color=colour, alpha=0.35, linewidth=0, label="mean response, 50 %")
    axes.plot(s_m, median, color=colour, linewidth=1.4, label="mean response, median")


def _means(axes: Axes, problem: PooledProblem) -> None:
    """Mean and sd as the calibration uses them: events without a reading count for what they say."""
    label: str | None = "recorded mean and sd across events (not reached counted in)"
    for column, sensor, middle in placed_sensors(problem):
        mean, sd = float(problem.recorded_mean[column]), float(np.sqrt(problem.covariance[column, column]))
        if sensor.is_span:
            axes.hlines(mean, sensor.s_from_m, sensor.s_to_m, color=RECORDED, linewidth=1.4)
        axes.errorbar(
            middle,
            mean,
            sd,
            label=label,
            fmt="D",
            color=RECORDED,
            markersize=5,
            capsize=3,
            markerfacecolor="white",
            zorder=5,
        )
        label = None
