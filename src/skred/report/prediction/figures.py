"""Figures of a prediction: how far, how fast, and how sure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
from skred.report.prediction.axis import probability_axis
from skred.report.prediction.table import prediction_table
from skred.report.shared.document import get
from skred.report.shared.labels import figure_text, printable, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.recordings import recordings_of
from skred.report.shared.style import (
    GREY,
    INK,
    RECORDED,
    folded,
    grow,
    is_narrow,
    law_colours,
    legend_below,
    new_figure,
    shades,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.report.shared.document import Document
    from skred.report.shared.recordings import Recordings

__all__ = ["FIGURES", "prediction_figure", "prediction_table", "uncertainty_figure"]
_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (1.5, 1.5)))
_LEAST_SHOWN, _FLOOR = 0.002, 0.0005
"""Lowest probability shown, and what stands for 0 on a logarithmic axis."""
_COMMON, _LEAD, _ZOOM_BELOW = 0.8, 0.12, 0.6
"""The enlarged part starts so far above the place that so many avalanches pass, if it is so much shorter."""
_TERRAIN = 0.45
"""Share of the panel that the terrain takes below the bars of distances."""
_ASIDE = 0.16
"""How far beside its peak a curve's name stands, as a share of the track."""
_WHITE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
_ABOVE: dict[str, Any] = {
    "textcoords": "offset points", "ha": "center", "va": "bottom", "fontsize": 8, "bbox": _WHITE,
}  # fmt: skip
_BESIDE: dict[str, Any] = {
    "zorder": 5,
    "textcoords": "offset points",
    "va": "center",
    "fontsize": 8,
    "bbox": _WHITE,
}
_PART_STYLES: dict[str, tuple[str, Any, str]] = {
    "event": ("#0072B2", "-", "from one avalanche to another"),
    "parameter": ("#D55E00", (0, (6, 2)), "population not known better"),
    "residual": ("#009E73", (0, (1.5, 1.5)), "error of a reading"),
    "total": (INK, "-", "all together"),
}
_MOST_TOLD = 60
"""Places of a curve that one can point at."""


@styled
def prediction_figure(document: Document, tree: xr.DataTree) -> Figure:
    """Speed and runout that shares of avalanches exceed along the track, with credible bands.

    Parameters
    ----------
    document : mapping
        The content of ``prediction.json``.
    tree : DataTree
        The content of ``prediction.nc``; what was recorded is drawn on the campaign's own track.
    """
    data, recordings = tree.to_dataset(), recordings_of(tree)
    title = f"The next avalanche on {figure_text(data.attrs['track'], 40)}: how fast, how far"
    figure = new_figure(7.6, f"{title}\n{figure_text(_subtitle(data, document), 100)}")
    windows = _windows(data)
    panels = _panels(figure, len(windows))
    colour = _colour(document)
    for column, window in enumerate(windows):
        speed, runout, profile = panels[:, column]
        last = column == len(windows) - 1
        _speeds(speed, data, colour, named=column == 0)
        _runout(runout, data, colour)
        _profile(profile, data, window, share=_TERRAIN if last else 1.0)
        if last:
            _distances(profile, data, colour)
        if data.attrs["track_is_own"]:
            _recorded(runout, recordings, window)
            if last:
                _recorded_speeds(speed, recordings, window)
        _reference((speed, runout, profile), data)
        if column > 0 and not is_narrow():
            for axes in (speed, runout):
                axes.tick_params(labelleft=False)
    _titles(panels, data)
    legend_below(figure, panels[:2].T.ravel(), columns=2)
    return figure


def _panels(figure: Figure, n: int) -> Any:
    """Speed, runout and terrain, (3, n) panels; in a narrow figure each window below the other."""
    ratios = [1.3, 1.15, 1.0]
    if not is_narrow() or n == 1:
        return figure.subplots(3, n, sharex="col", squeeze=False, gridspec_kw={"height_ratios": ratios})
    grow(figure, 1.45)
    panels = figure.subplots(3 * n, 1, squeeze=False, gridspec_kw={"height_ratios": n * ratios})
    panels = panels[:, 0].reshape(n, 3).T
    for column in range(n):
        for axes in panels[:2, column]:
            axes.sharex(panels[2, column])
            axes.tick_params(labelbottom=False)
    return panels


def _titles(panels: Any, data: xr.Dataset) -> None:
    """Titles, and labels of the axes."""
    titles = (
        "Front speed that 50, 10 and 1 % of avalanches exceed",
        "Probability that an avalanche runs beyond s",
        "Terrain",
    )
    for axes, title in zip(panels[:, 0], titles, strict=True):
        axes.set_title(title)
    panels[2, -1].set_title("Distance that 50, 10 and 1 % exceed")
    labels = (f"front speed [{unit_text('m s-1')}]", "probability", "elevation [m]")
    for column in panels.T if is_narrow() else panels.T[:1]:
        for axes, label in zip(column, labels, strict=True):
            axes.set_ylabel(label)
    if panels.shape[1] > 1:
        panels[2, 1].set_xlabel("s, the part where most stop [m]")
    panels[2, 0].set_xlabel(f"s [m], release at {figure_text(data.attrs['release_short'], 45)}")


def _windows(data: xr.Dataset) -> list[tuple[float, float]]:
    """Stretches of the track to show: all of it, and the one where most avalanches stop if that is short."""
    s_m, chance = data["s"].values, data["runout_probability"].values
    whole_track = (_start(data), float(s_m[-1]))
    length = whole_track[1] - whole_track[0]
    common = np.flatnonzero(chance >= _COMMON)
    low = float(s_m[common[-1]]) - _LEAD * length if len(common) else whole_track[0]
    # Beyond where a share of avalanches as small as the smallest told of runs, nothing is to be seen.
    high = min(whole_track[1], float(data["runout_quantile_high"].values[-1]) + 0.04 * length)
    wide = [] if high - low > _ZOOM_BELOW * length or low <= whole_track[0] else [(low, high)]
    return [whole_track, *wide]


def _colour(document: Document) -> str:
    law_id = str(get(document, "law", "id"))
    return law_colours([law_id])[law_id]


def _subtitle(data: xr.Dataset, document: Document) -> str:
    title, campaign = printable(get(document, "law", "title")), data.attrs["campaign"]
    return f"{title}, calibrated on {campaign}; bands: 90 % credible"


def _start(data: xr.Dataset) -> float:
    """Where fronts are first seen [m]."""
    comes = np.flatnonzero(data["arrival_probability"].values > 0.0)
    return float(data["s"].values[comes[0]]) if len(comes) else 0.0


def _speeds(axes: Axes, data: xr.Dataset, colour: str, *, named: bool) -> None:
    """Speed that each share of avalanches exceeds."""
    s_m = data["s"].values
    light, middle_tone, dark = reversed(shades(colour, 3))
    for k, (q, tone) in enumerate(zip(data["share"].values, (light, middle_tone, dark), strict=True)):
        low, high = (data[f"speed_quantile_{end}"].values[:, k] for end in ("low", "high"))
        value = data["speed_quantile"].values[:, k]
        axes.fill_between(s_m, low, high, color=tone, alpha=0.28, linewidth=0)
        label = f"speed that {100 * q:g} % of avalanches exceed"
        _tell(
            axes,
            s_m,
            value,
            [
                f"{100 * q:g} % exceed {v:.1f} m/s ({a:.1f} to {b:.1f})"
                for v, a, b in zip(value, low, high, strict=True)
            ],
        )
        axes.plot(s_m, value, color=tone, linestyle=_DASHES[k % 3], linewidth=1.6, label=label)
        if named:
            _name(axes, s_m, value, k, f"{100 * q:g} %")
    axes.set_ylim(0, 1.05 * max(1.0, float(data["speed_quantile_high"].max())))
    axes.grid(axis="y")


def _name(axes: Axes, s_m: FloatArray, value: FloatArray, number: int, text: str) -> None:
    """Name one of three curves near its peak, where none of the names lies on another."""
    peak = int(value.argmax())
    aside, offset, upright = ((0.0, -4, "top"), (_ASIDE, 0, "center"), (0.0, 4, "bottom"))[number % 3]
    place = min(float(s_m[peak] + aside * (s_m[-1] - s_m[0])), float(s_m[-1]))
    at = (place, float(np.interp(place, s_m, value)))
    axes.annotate(text, at, (0, offset), **_ABOVE | {"va": upright})


def _runout(axes: Axes, data: xr.Dataset, colour: str) -> None:
    """Probability of running beyond each place."""
    s_m = data["s"].values
    low, high, value = (
        np.maximum(data[f"runout_probability{end}"].values, _FLOOR) for end in ("_low", "_high", "")
    )
    axes.fill_between(s_m, low, high, color=colour, alpha=0.28, linewidth=0)
    axes.plot(s_m, value, color=colour, linewidth=1.6, label="share that runs beyond s")
    found = zip(*(data[f"runout_probability{end}"].values for end in ("", "_low", "_high")), strict=True)
    _tell(
        axes,
        s_m,
        value,
        [f"{100 * v:.3g} % run farther ({100 * a:.3g} to {100 * b:.3g} %)" for v, a, b in found],
    )
    probability_axis(axes, _LEAST_SHOWN)
    axes.grid()


def _tell(axes: Axes, s_m: FloatArray, value: FloatArray, words: list[str]) -> None:
    """Say what a curve is at some places in the panel's window, and at few others."""
    at = np.linspace(0, len(s_m) - 1, min(len(s_m), _MOST_TOLD)).astype(int)
    mark(axes, s_m[at], value[at], [f"s = {s_m[k]:.0f} m\n{words[k]}" for k in at])


def _profile(axes: Axes, data: xr.Dataset, window: tuple[float, float], *, share: float) -> None:
    """Terrain in a window, in the lower share of the panel."""
    s_m, z_m = data["s"].values, data["z"].values
    inside = np.union1d(s_m[(s_m >= window[0]) & (s_m <= window[1])], window)
    z_inside = np.interp(inside, s_m, z_m)
    height = float(np.ptp(z_inside)) or 1.0
    bottom = z_inside.min() - 0.12 * height
    axes.fill_between(s_m, z_m, bottom, color="#ececec", linewidth=0)
    axes.plot(s_m, z_m, color=INK, linewidth=1.0)
    axes.set_ylim(bottom, bottom + 1.12 * height / share)
    axes.set_xlim(*window)
    axes.locator_params(axis="x", nbins=6)


def _distances(axes: Axes, data: xr.Dataset, colour: str) -> None:
    """How far the shares of avalanches run, as bars above the terrain."""
    s_m, z_m = data["s"].values, data["z"].values
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    tones = reversed(shades(colour, 3))
    for k, (q, tone) in enumerate(zip(data["share"].values, tones, strict=True)):
        value, low, high = (float(data[f"runout_quantile{end}"].values[k]) for end in ("", "_low", "_high"))
        level = bottom + (_TERRAIN + 0.1 + 0.19 * k) * (top - bottom)
        axes.plot([value, value], [np.interp(value, s_m, z_m), level], color=tone, linewidth=0.8)
        axes.plot([low, high], [level, level], color=tone, alpha=0.45, linewidth=6, solid_capstyle="butt")
        axes.plot(value, level, marker="o", color=tone, markersize=5, clip_on=False)
        text = f"{100 * q:g} %: {'≥ ' if value >= s_m[-1] else ''}{value:.0f} m"
        before = low - left > 0.22 * (right - left)
        at, offset, side = (low, -5, "right") if before else (high, 5, "left")
        axes.annotate(text, (at, level), (offset, 0), ha=side, **_BESIDE)


def _recorded(axes: Axes, recordings: Recordings, window: tuple[float, float]) -> None:
    """Share of the recorded avalanches that ran beyond s."""
    of_runout = recordings.is_runout
    values = np.sort(recordings.values[:, of_runout][recordings.observed[:, of_runout]])
    n = len(values)
    if n == 0:
        return
    beyond = np.maximum(1.0 - np.arange(n + 1) / n, _FLOOR)
    label = f"the same of the {n} recorded"
    axes.step(
        [min(window[0], values[0]), *values], beyond, where="post", color=RECORDED, linewidth=1.1, label=label
    )


def _recorded_speeds(axes: Axes, recordings: Recordings, window: tuple[float, float]) -> None:
    """Recorded speeds at their sensors, a span's at its middle."""
    label: str | None = "recorded speeds (spread sideways)"
    half_width = 0.012 * (window[1] - window[0])
    for column, sensor in enumerate(recordings.sensors):
        values = np.sort(recordings.values[recordings.observed[:, column], column])
        if sensor.is_runout or len(values) == 0:
            continue
        middle = 0.5 * (sensor.s_from_m + sensor.s_to_m)
        sideways = half_width * np.linspace(-1.0, 1.0, len(values)) if len(values) > 1 else np.zeros(1)
        axes.plot(middle + sideways, values, "o", color=RECORDED, markersize=2.4, label=label, zorder=4)
        label = None


def _reference(panels: tuple[Axes, ...], data: xr.Dataset) -> None:
    reference = data.attrs.get("reference_s_m")
    if reference is None:
        return
    for axes in panels:
        label = f"reference (zero of reported runouts), s = {reference:.0f} m" if axes is panels[0] else None
        axes.axvline(float(reference), color=GREY, linewidth=0.9, linestyle="--", label=label)


@styled
def uncertainty_figure(document: Document, tree: xr.DataTree) -> Figure:
    """Standard deviations of speed and runout by where they come from.

    Parameters
    ----------
    document : mapping
        The content of ``prediction.json``.
    tree : DataTree
        The content of ``prediction.nc``.
    """
    data = tree.to_dataset()
    title = f"Where the uncertainty comes from, on {figure_text(data.attrs['track'], 40)}"
    figure = new_figure(6.6, f"{title}\n{figure_text(_subtitle(data, document), 100)}")
    if is_narrow():
        grow(figure, 1.2)
    speed, arrival, runout = figure.subplots(3, 1, gridspec_kw={"height_ratios": [1.6, 0.7, 1.0]})
    s_m = data["s"].values
    for part, (colour, dashes, label) in _PART_STYLES.items():
        values = data[f"speed_sd_{part}"].values
        width = 1.0 if part == "total" else 1.7
        _tell(speed, s_m, values, [f"{label}: {one:.2f} m/s" for one in values])
        speed.plot(s_m, values, color=colour, linestyle=dashes, linewidth=width, label=label)
    speed.set_ylabel(f"sd of speed [{unit_text('m s-1')}]")
    speed.set_ylim(bottom=0.0)
    speed.set_title("Speed: standard deviation among the avalanches that come to s")
    _arrival(arrival, data, _colour(document))
    for axes in (speed, arrival):
        axes.set_xlim(_start(data), s_m[-1])
        axes.grid(axis="y")
    _reference((speed, arrival), data)
    speed.tick_params(labelbottom=False)
    arrival.set_xlabel("s along the track [m]")
    _runout_parts(runout, data)
    legend_below(figure, (speed, runout), columns=2)
    return figure


def _arrival(axes: Axes, data: xr.Dataset, colour: str) -> None:
    s_m = data["s"].values
    low, high = (data[f"arrival_probability_{end}"].values for end in ("low", "high"))
    axes.fill_between(s_m, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(s_m, data["arrival_probability"].values, color=colour, linewidth=1.4)
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("probability")
    axes.set_title("Probability of coming to s, with its credible band")


def _runout_parts(axes: Axes, data: xr.Dataset) -> None:
    """Bars of the runout's standard deviations: of all avalanches, and of those as long as recorded ones."""
    parts = [part for part in _PART_STYLES if np.isfinite(float(data[f"runout_sd_{part}"]))]
    groups: list[tuple[str, float, str | None]] = [("runout", 1.0, None)]
    if "long_runout_mean" in data:
        least = data.attrs["shortest_recorded_runout_m"]
        long = f"runouts beyond the shortest recorded one, s = {least:.0f} m"
        groups = [("long_runout", 1.0, long), ("runout", 0.45, "runouts of all avalanches")]
    height = 0.76 / len(groups)
    highest = 1.0
    for number, (name, alpha, label) in enumerate(groups):
        for k, part in enumerate(parts):
            value = float(data[f"{name}_sd_{part}"])
            highest = max(highest, value)
            place = k + (number - 0.5 * (len(groups) - 1)) * height
            axes.barh(
                place, value, color=_PART_STYLES[part][0], alpha=alpha, height=0.92 * height,
                label=None if k < len(parts) - 1 else label,
            )  # fmt: skip
            axes.annotate(
                f"{value:.0f} m",
                (value, place),
                (4, 0),
                textcoords="offset points",
                va="center",
                fontsize=7.5,
            )
    axes.set_yticks(range(len(parts)), [folded(_PART_STYLES[part][2], 22) for part in parts])
    axes.invert_yaxis()
    axes.set_xlim(0, 1.1 * highest)
    axes.set_xlabel("sd of runout [m]")
    axes.set_title("Runout: standard deviation (variances add up, standard deviations do not)")


FIGURES = {"prediction": prediction_figure, "uncertainty": uncertainty_figure}
"""Makers of all figures by their names."""
