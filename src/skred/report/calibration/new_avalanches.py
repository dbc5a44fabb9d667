"""Figures of new avalanches of a population: their readings at each sensor, and their speed on the way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.calibration.predictive import recorded_marks
from skred.report.shared.draws import (
    NewAvalanche,
    density,
    left_out,
    new_avalanche,
    sensor_title,
    shaded_density,
    shown_sensors,
)
from skred.report.shared.labels import figure_text
from skred.report.shared.law import law_of
from skred.report.shared.recordings import recordings_of
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


_SHOWN = (0.002, 0.998)
"""Quantiles of the new avalanches that a panel reaches to at least."""


@styled
def new_avalanche_figure(tree: xr.DataTree) -> Figure:
    """Distribution of a new avalanche's reading against the recorded one, of each of up to twelve sensors."""
    law, recordings = law_of(tree), recordings_of(tree)
    sensors = shown_sensors(recordings)
    rows, columns = grid_for(len(sensors))
    title = f"A new avalanche against the recorded ones{left_out(recordings.n_sensors)}"
    height = 1.1 + (2.75 if columns > 2 else 2.5) * rows
    figure = new_figure(height, f"{title}\n{figure_text(law.title, 80)}")
    panels = panels_in(figure, len(sensors), columns)
    colour = law_colours([law.id])[law.id]
    for axes, sensor in zip(panels, sensors, strict=True):
        draws = new_avalanche(tree, recordings, sensor)
        _reading_panel(axes, draws, colour)
        text = f"{sensor_title(sensor)}\n{reached_text(draws, recordings.length_m)}"
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
    missing = f", {draws.n_bounds} known by bounds" if draws.n_bounds else ""
    missing += f", {draws.n_missing} missing" if draws.n_missing else ""
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
def new_avalanche_track_figure(tree: xr.DataTree) -> Figure:
    """Bands of new avalanches' speeds; apart from them, how well the median is known; the terrain below."""
    law, recordings = law_of(tree), recordings_of(tree)
    found = tree["along_track"].to_dataset()
    colour = law_colours([law.id])[law.id]

    def draw(axes: Axes) -> None:
        s_m, speed, medians = found["s"].values, found["speed"], found["median_speed"]
        for tail, amount in ((0.05, 0.2), (0.25, 0.42)):
            low, high = (speed.sel(quantile=share, method="nearest").values for share in (tail, 1.0 - tail))
            label = f"new avalanches, {100 - 200 * tail:.0f} %"
            axes.fill_between(s_m, low, high, color=tint(colour, amount), linewidth=0, label=label)
        low, median, high = (
            medians.sel(quantile=share, method="nearest").values for share in (0.05, 0.5, 0.95)
        )
        dark = shades(colour, 2)[0]
        axes.fill_between(
            s_m, low, high, color=dark, alpha=0.55, linewidth=0, label="their median, 90 % interval"
        )
        axes.plot(s_m, median, color=INK, linewidth=1.0, label="their median")

    what = "Front speed of new avalanches along the track (0 where they have stopped)"
    title = f"{what}\n{figure_text(law.title, 80)}"
    top = 1.05 * max(float(found["speed"].values[-1].max()), 1.0, *highest_recorded(recordings))
    return track_figure(recordings, title, draw, top=top, start=_start(found["release"].values))


def _start(releases: FloatArray) -> tuple[float, str]:
    """Where the track is shown from, and words for it, by the quantiles of the releases."""
    low, high = float(releases[0]), float(releases[-1])
    if high - low < 0.5:
        return low, f"release at s = {low:.0f} m"
    return low, f"releases, 90 % between s = {low:.0f} and {high:.0f} m"
