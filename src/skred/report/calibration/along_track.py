"""Figure of the mean response's front speed along the track, with recordings and terrain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.shared.labels import figure_text
from skred.report.shared.law import law_of
from skred.report.shared.recordings import recordings_of
from skred.report.shared.style import RECORDED, law_colours, styled
from skred.report.shared.track_panels import highest_recorded, track_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.report.shared.recordings import Recordings


@styled
def along_track_figure(tree: xr.DataTree) -> Figure:
    """Median and 50 and 90 % bands of the mean response's speed, and the terrain below."""
    law, recordings = law_of(tree), recordings_of(tree)
    found, constant = tree["along_track"].to_dataset(), tree["constant_data"].to_dataset()
    mean, sd = constant["recorded_mean"].values, np.sqrt(np.diagonal(constant["covariance"].values))
    colour = law_colours([law.id])[law.id]

    def draw(axes: Axes) -> None:
        _bands(axes, found["s"].values, found["speed"].values, colour)
        _means(axes, recordings, mean, sd)

    title = f"Front speed along the track, and what was recorded\n{figure_text(law.title, 80)}"
    release = float(np.median(recordings.release_s_m))
    start = (release, _release_text(recordings, release))
    top = _top(found["speed"].values, recordings, mean + sd)
    return track_figure(recordings, title, draw, top=top, start=start)


def _release_text(recordings: Recordings, release: float) -> str:
    n_releases = len(np.unique(recordings.release_s_m))
    which = f", the median of {n_releases} places" if n_releases > 1 else ""
    return f"release at s = {release:.0f} m{which}"


def _top(bands: FloatArray, recordings: Recordings, high: FloatArray) -> float:
    """Upper end of the speed axis: everything is inside."""
    of_speed = [column for column, _, _ in recordings.placed()]
    finite = high[of_speed][np.isfinite(high[of_speed])].tolist()
    return 1.05 * max(float(bands[-1].max()), 1.0, *highest_recorded(recordings), *finite)


def _bands(axes: Axes, s_m: FloatArray, bands: FloatArray, colour: str) -> None:
    low, lower, median, upper, high = bands
    axes.fill_between(s_m, low, high, color=colour, alpha=0.22, linewidth=0, label="mean response, 90 %")
    axes.fill_between(s_m, lower, upper, color=colour, alpha=0.35, linewidth=0, label="mean response, 50 %")
    axes.plot(s_m, median, color=colour, linewidth=1.4, label="mean response, median")


def _means(axes: Axes, recordings: Recordings, means: FloatArray, sds: FloatArray) -> None:
    """Mean and sd as the calibration uses them: events without a reading count for what they say."""
    label: str | None = "recorded mean and sd across events (not reached counted in)"
    for column, sensor, middle in recordings.placed():
        mean, sd = float(means[column]), float(sds[column])
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
