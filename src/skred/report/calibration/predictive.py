"""Figure of each sensor: what was recorded, the mean response, and the predictive distribution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.shared.draws import (
    SensorDraws,
    density,
    floats_of,
    left_out,
    sensor_draws,
    sensor_title,
    shown_sensors,
)
from skred.report.shared.labels import figure_text
from skred.report.shared.law import law_of
from skred.report.shared.recordings import recordings_of
from skred.report.shared.style import (
    GREY,
    RECORDED,
    bare,
    grid_for,
    law_colours,
    legend_below,
    new_figure,
    panels_in,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_PREDICTIVE = "predicted reading of a new avalanche (mean response, Sigma)"
_RESPONSE_HEIGHT = 1.25
"""Peak of the mean response over that of the predictive distribution, in the drawing."""


@styled
def predictive_figure(tree: xr.DataTree) -> Figure:
    """One panel per sensor, up to twelve."""
    law, recordings = law_of(tree), recordings_of(tree)
    sensors = shown_sensors(recordings)
    rows, columns = grid_for(len(sensors))
    title = f"Predicted against recorded{left_out(recordings.n_sensors)}\n{figure_text(law.title, 80)}"
    figure = new_figure(1.0 + (2.4 if columns > 2 else 2.15) * rows, title)
    panels = panels_in(figure, len(sensors), columns)
    for axes, sensor in zip(panels, sensors, strict=True):
        _panel(axes, sensor_draws(tree, recordings, sensor), law_colours([law.id])[law.id], small=columns > 2)
    legend_below(figure, panels, columns=2)
    return figure


def _panel(axes: Axes, draws: SensorDraws, colour: str, *, small: bool) -> None:
    reading, response, recorded = floats_of(draws.reading), floats_of(draws.response), draws.recorded
    low, high = np.quantile(reading, [0.002, 0.998])
    low, high = (float(f([*recorded, limit])) for f, limit in ((np.min, low), (np.max, high)))
    margin = 0.03 * (high - low) or 1.0
    grid = np.linspace(low - margin, high + margin, 300)
    predictive = density(reading, grid)
    axes.fill_between(grid, predictive, color=colour, alpha=0.25, linewidth=0, label=_PREDICTIVE)
    recorded_marks(axes, recorded)
    top = max(predictive.max(), axes.get_ylim()[1] / 1.05)
    peak = density(response, grid)
    peak *= _RESPONSE_HEIGHT * top / peak.max()
    axes.plot(grid, peak, color=colour, linewidth=1.3, label="mean response (posterior; height not to scale)")
    if low < 0 and not draws.sensor.is_runout:
        axes.axvline(
            0, color=GREY, linewidth=0.8, linestyle=":", label="left of 0: would not reach the sensor"
        )
    axes.set_xlim(grid[0], grid[-1])
    axes.set_ylim(-0.09 * top, 1.4 * top)
    title, counts = sensor_title(draws.sensor), _counts(draws)
    if small:
        title, counts = title.replace(": ", "\n", 1), counts.replace(", ", "\n", 1)
    axes.set_title(f"{title}\n{counts}", fontsize=7.5 if small else 8)
    axes.set_xlabel(draws.axis_label)
    bare(axes)


def recorded_marks(axes: Axes, recorded: FloatArray) -> None:
    """Histogram and rug of the recordings, on the scale of the predictive density."""
    if len(recorded) == 0:
        return
    bins = int(np.clip(1.5 * np.sqrt(len(recorded)), 4, 30))
    if np.ptp(recorded) > 0:
        axes.hist(recorded, bins=bins, density=True, histtype="step", color=RECORDED, linewidth=0.9)
    top = axes.get_ylim()[1]
    axes.plot(
        recorded,
        np.full(len(recorded), -0.045 * top),
        linestyle="none",
        marker="|",
        markersize=7,
        color=RECORDED,
        label="recorded (ticks and histogram)",
    )


def _counts(draws: SensorDraws) -> str:
    """How many readings there are, in words short enough for a panel."""
    parts = [f"{len(draws.recorded)} recorded"]
    zeros = int(np.sum(draws.recorded + draws.offset == 0))
    if zeros and not draws.sensor.is_runout:
        parts[0] += f" ({zeros} of them 0)"
    if draws.n_not_reached:
        parts.append(f"{draws.n_not_reached} not reached")
    if draws.n_bounds:
        parts.append(f"{draws.n_bounds} known by bounds, not drawn")
    if draws.n_missing:
        parts.append(f"{draws.n_missing} missing")
    return ", ".join(parts)
