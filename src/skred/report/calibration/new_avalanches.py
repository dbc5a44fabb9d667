"""Figures of new avalanches of a population: their readings at each sensor, and their speed on the way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skred.report.calibration.predictive import recorded_marks
from skred.report.shared.draws import (
    NewAvalanche,
    chains_of,
    density,
    left_out,
    new_avalanche,
    sensor_title,
    shaded_density,
    shown_sensors,
)
from skred.report.shared.labels import figure_text
from skred.report.shared.style import (
    INK,
    bare,
    grid_for,
    law_colours,
    legend_below,
    new_figure,
    panels_in,
    shades,
    styled,
    tint,
)
from skred.report.shared.track_panels import highest_recorded, track_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.inference.problem import Problem
    from skred.physics.law import Law

FloatArray = NDArray[np.float64]
_MAX_AVALANCHES = 1000
_MEDIANS, _AVALANCHES_OF_A_MEDIAN = 120, 100
_SHOWN = (0.002, 0.998)
"""Quantiles of the new avalanches that a panel reaches to at least."""


@styled
def new_avalanche_figure(tree: xr.DataTree, law: Law, problem: Problem) -> Figure:
    """Distribution of a new avalanche's reading against the recorded one, of each of up to twelve sensors."""
    sensors = shown_sensors(problem.campaign)
    rows, columns = grid_for(len(sensors))
    title = f"A new avalanche against the recorded ones{left_out(problem.campaign.n_sensors)}"
    height = 1.1 + (2.75 if columns > 2 else 2.5) * rows
    figure = new_figure(height, f"{title}\n{figure_text(law.title, 80)}")
    panels = panels_in(figure, len(sensors), columns)
    colour = law_colours([law.id])[law.id]
    for axes, sensor in zip(panels, sensors, strict=True):
        draws = new_avalanche(tree, problem, sensor)
        _reading_panel(axes, draws, colour)
        text = f"{sensor_title(sensor)}\n{reached_text(draws, problem.terrain.length_m)}"
        if columns > 2:
            text = text.replace(": ", "\n", 1)
        axes.set_title(text, fontsize=7.5 if columns > 2 else 8)
    legend_below(figure, panels, columns=2)
    return figure


def _reading_panel(axes: Axes, draws: NewAvalanche, colour: str) -> None:
    recorded = draws.recorded
    shown = [*np.quantile(draws.reading, _SHOWN)] if len(draws.reading) else []
    limits = [*recorded, *shown] or [0.0, 1.0]
    low, high = float(min(limits)), float(max(limits))
    margin = 0.03 * (high - low) or 1.0
    grid = np.linspace(low - margin, high + margin, 500)
    recorded_marks(axes, recorded)
    top = axes.get_ylim()[1] if len(recorded) else 0.0
    if len(draws.reading):
        top = max(top / 1.05, _predicted(axes, draws, grid, colour))
    else:
        axes.text(0.5, 0.5, "no new avalanche gets here", transform=axes.transAxes, ha="center")
        top = top or 1.0
    axes.set_xlim(grid[0], grid[-1])
    axes.set_ylim(-0.09 * top, 1.08 * top)
    axes.set_xlabel(draws.axis_label)
    axes.locator_params(axis="x", nbins=7)
    bare(axes)


def _predicted(axes: Axes, draws: NewAvalanche, grid: FloatArray, colour: str) -> float:
    """Density of the reading with its 50 and 90 % intervals, and of the front; the highest value."""
    lower = None if draws.sensor.is_runout else 0.0
    inside = grid if lower is None else grid[grid >= lower]
    reading, front = (density(values, inside, lower=lower) for values in (draws.reading, draws.front))
    shaded_density(axes, inside, reading, draws.reading, colour, "reading of a new avalanche that gets here")
    label = "its front, without the reading's error"
    axes.plot(inside, front, color=shades(colour, 2)[0], linewidth=1.0, label=label)
    return float(max(reading.max(), front.max()))


def reached_text(draws: NewAvalanche, end_m: float) -> str:
    """How likely a new avalanche is to get to a sensor, beside how many of the recorded ones did."""
    n_read, zeros = len(draws.recorded), int(np.sum(draws.recorded + draws.offset == 0))
    missing = f", {draws.n_missing} missing" if draws.n_missing else ""
    if draws.sensor.is_runout:
        beyond = float(np.mean(draws.front + draws.offset >= end_m - 0.5)) if len(draws.front) else 0.0
        leaves = f"{_percent(beyond)} of new avalanches leave the track\n" if beyond > 0 else ""
        return f"{leaves}{n_read} recorded{missing}"
    n_known = n_read + draws.n_not_reached
    if n_known == 0:
        return f"reached by {_percent(draws.reached)} of new avalanches,\nnothing recorded"
    zero_readings = f" ({zeros} read 0)" if zeros else ""
    return (
        f"reached by {_percent(draws.reached)} of new avalanches,\n"
        f"by {n_read} of {n_known} recorded{zero_readings}{missing}"
    )


def _percent(value: float) -> str:
    """A share in percent, never rounded to none or all."""
    if 0.0 < value < 0.005:
        return "less than 1 %"
    if 0.995 <= value < 1.0:
        return "more than 99 %"
    return f"{100 * value:.0f} %"


@styled
def new_avalanche_track_figure(tree: xr.DataTree, law: Law, problem: Problem) -> Figure:
    """Bands of new avalanches' speeds; apart from them, how well the median is known; the terrain below."""
    strengths, releases = _avalanches(tree, law)
    speeds = problem.speeds(law.mechanisms, strengths, releases)
    medians = _median_speeds(tree, law, problem, releases)
    colour = law_colours([law.id])[law.id]

    def draw(axes: Axes) -> None:
        s_m = problem.terrain.edge_s_m
        for tail, amount in ((0.05, 0.2), (0.25, 0.42)):
            low, high = np.quantile(speeds, [tail, 1.0 - tail], axis=0)
            label = f"new avalanches, {100 - 200 * tail:.0f} %"
            axes.fill_between(s_m, low, high, color=tint(colour, amount), linewidth=0, label=label)
        low, median, high = np.quantile(medians, [0.05, 0.5, 0.95], axis=0)
        dark = shades(colour, 2)[0]
        axes.fill_between(
            s_m, low, high, color=dark, alpha=0.55, linewidth=0, label="their median, 90 % interval"
        )
        axes.plot(s_m, median, color=INK, linewidth=1.0, label="their median")

    what = "Front speed of new avalanches along the track (0 where they have stopped)"
    title = f"{what}\n{figure_text(law.title, 80)}"
    top = 1.05 * max(float(np.quantile(speeds, 0.95, axis=0).max()), 1.0, *highest_recorded(problem))
    return track_figure(problem, title, draw, top=top, start=_start(releases))


def _start(releases: FloatArray) -> tuple[float, str]:
    low, high = np.quantile(releases, [0.05, 0.95])
    if high - low < 0.5:
        return float(low), f"release at s = {low:.0f} m"
    return float(low), f"releases, 90 % between s = {low:.0f} and {high:.0f} m"


def _avalanches(tree: xr.DataTree, law: Law) -> tuple[FloatArray, FloatArray]:
    """Strengths (n, n_strengths) and releases (n,) of randomly chosen new avalanches."""
    predictive = tree["posterior_predictive"].to_dataset()
    names = [*(mechanism.strength.name for mechanism in law.mechanisms), "release"]
    rows = [predictive[name].transpose("chain", "draw", "event").values.ravel() for name in names]
    n = len(rows[0])
    chosen = np.random.default_rng(0).permutation(n)[:_MAX_AVALANCHES]
    table = np.column_stack(rows)[chosen]
    return np.ascontiguousarray(table[:, :-1]), np.ascontiguousarray(table[:, -1])


def _median_speeds(tree: xr.DataTree, law: Law, problem: Problem, releases: FloatArray) -> FloatArray:
    """Median speed across new avalanches for each of some draws of the population, (n_draws, n_edges).

    The avalanches of all draws are the same ones in standard deviations (a Latin hypercube), so that
    the medians differ by the population alone.
    """
    from scipy.special import ndtri

    from skred.inference.hierarchical.population import population_of

    samples = {p.name: chains_of(tree, p.name).ravel() for p in problem.parameters(law)}
    n = len(next(iter(samples.values())))
    chosen = np.unique(np.linspace(0, n - 1, min(n, _MEDIANS)).astype(int))
    means, factors = population_of(law, {name: values[chosen] for name, values in samples.items()})
    rng = np.random.default_rng(0)
    size = _AVALANCHES_OF_A_MEDIAN
    ranks = np.column_stack([rng.permutation(size) for _ in law.mechanisms])
    deviations = ndtri((ranks + 0.5) / size)
    places = np.resize(releases, size)
    rows = [np.exp(mean + deviations @ factor.T) for mean, factor in zip(means, factors, strict=True)]
    return np.array([np.median(problem.speeds(law.mechanisms, row, places), axis=0) for row in rows])
