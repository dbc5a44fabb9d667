"""The profile of a track: terrain, slope angle, and what smoothing took away."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.shared.labels import figure_text, shortened
from skred.report.shared.numbers import fixed
from skred.report.shared.style import GREY, INK, PALETTE, legend_below, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.table import Table

_SAMPLED, _WRITTEN, _READ, _EXTENSION, _RELEASE = "#9a9a9a", PALETTE[0], PALETTE[2], PALETTE[1], PALETTE[3]
_AS_READ = "as other commands smooth it when they read it"


@styled
def track_figure(document: Mapping[str, Any]) -> Figure:
    """Elevation, slope angle and what smoothing took away, along the track.

    Parameters
    ----------
    document : mapping
        The document beside a ``track.csv``.
    """
    profile = {name: np.array(values) for name, values in document["profile"].items()}
    line = figure_text(document["line"]["name"] or document["line"]["file"], 40)
    terrain = figure_text(document["terrain"]["file"], 40)
    figure = new_figure(6.4, f"Track along {line}\n{terrain}, {_summary(document)}")
    panels = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [2.0, 1.4, 0.8]})
    _elevation(panels[0], profile)
    _slope(panels[1], profile)
    _taken(panels[2], profile, document["smoothing"]["smoothing_m"])
    for axes in panels:
        axes.grid(axis="y")
        axes.set_xlim(0.0, profile["s_m"][-1])
        _mark_extension(axes, document["extension"])
    _mark_releases(panels[0], document["releases"], profile)
    panels[2].set_xlabel("s along the track [m]")
    figure.align_ylabels(panels)
    legend_below(figure, panels, columns=2)
    return figure


def _summary(document: Mapping[str, Any]) -> str:
    """Length and fall in words."""
    written, step = document["smoothing"]["written"], document["step_m"]
    horizontal = document["profile"]["x_m"][-1]
    length = f"{written['length_m']:.0f} m along the slope, {horizontal:.0f} m on the map"
    return f"{length}, {written['fall_m']:.0f} m of fall, a point every {step:.3g} m"


def _elevation(axes: Axes, profile: Mapping[str, Any]) -> None:
    s_m, z_m = profile["s_m"], profile["z_m"]
    low = z_m.min() - 0.06 * float(np.ptp(z_m))
    axes.fill_between(s_m, z_m, low, color="#ececec", linewidth=0)
    axes.plot(s_m, profile["z_sampled_m"], color=_SAMPLED, linewidth=2.2, label="as in the terrain model")
    axes.plot(s_m, z_m, color=_WRITTEN, linewidth=1.1, label="as written")
    axes.set_ylim(low, z_m.max() + 0.08 * float(np.ptp(z_m)))
    axes.set_ylabel("elevation [m]")
    axes.set_title("Terrain")


def _slope(axes: Axes, profile: Mapping[str, Any]) -> None:
    s_m, x_m = profile["s_m"], profile["x_m"]
    middle = 0.5 * (s_m[1:] + s_m[:-1])
    looks: dict[str, dict[str, Any]] = {
        "z_sampled_m": {"color": _SAMPLED, "linewidth": 1.0},
        "z_m": {"color": _WRITTEN, "linewidth": 1.3},
        "z_read_m": {"color": _READ, "linewidth": 1.1, "linestyle": "--", "label": _AS_READ},
    }
    for name, look in looks.items():
        if name == "z_read_m":  # smoothed along the arc length, not over the distance on the map
            slope = np.degrees(np.arcsin(np.clip(-np.diff(profile[name]) / np.diff(s_m), -1.0, 1.0)))
        else:
            slope = np.degrees(np.arctan2(-np.diff(profile[name]), np.diff(x_m)))
        axes.plot(middle, slope, **look)
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylabel("degrees")
    axes.set_title("Slope angle, downhill above 0")


def _taken(axes: Axes, profile: Mapping[str, Any], smoothing_m: float) -> None:
    axes.plot(profile["s_m"], profile["z_m"] - profile["z_sampled_m"], color=_WRITTEN, linewidth=1.0)
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylabel("m")
    axes.set_title(f"How smoothing by {smoothing_m:g} m moves the ground")


def _mark_extension(axes: Axes, extension: Mapping[str, Any] | None) -> None:
    if extension is None or extension["s_to_m"] <= extension["s_from_m"]:
        return
    label = f"extended along the fall line, from s = {extension['s_from_m']:.0f} m"
    axes.axvspan(
        extension["s_from_m"], extension["s_to_m"], color=_EXTENSION, alpha=0.13, linewidth=0, label=label
    )
    axes.axvline(extension["s_from_m"], color=_EXTENSION, linewidth=0.9, linestyle="--")


def _mark_releases(axes: Axes, releases: list[Mapping[str, Any]], profile: Mapping[str, Any]) -> None:
    """Release areas as thick stretches of the terrain, points as dots."""
    label: str | None = "release"
    for one in releases:
        if one["s_to_m"] is None:
            continue
        s_m = np.linspace(one["s_from_m"], one["s_to_m"], 40)
        z_m = np.interp(s_m, profile["s_m"], profile["z_m"])
        axes.plot(s_m, z_m, color=_RELEASE, linewidth=4.0, solid_capstyle="butt", label=label)
        axes.plot(s_m[-1], z_m[-1], "o", color=_RELEASE, markersize=4.5, markeredgecolor=GREY)
        label = None


def track_shape_table(document: Mapping[str, Any]) -> Table:
    """What the track amounts to before and after smoothing, for the terminal.

    Parameters
    ----------
    document : mapping
        The document beside a ``track.csv``.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    line = document["line"]
    name, points = shortened(line["name"] or line["file"], 60), len(document["profile"]["x_m"])
    title = Text(f"{name}: a track of {points} points")
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1))
    table.add_column("")
    for column in ("as sampled", "as written", "unit"):
        table.add_column(column, justify="right", no_wrap=True)
    before, after = (document["smoothing"][name] for name in ("sampled", "written"))
    for what, name, unit in (
        ("fall", "fall_m", "m"),
        ("length along the slope", "length_m", "m"),
        ("steepest slope", "steepest_deg", "degrees"),
        ("steepest rise", "steepest_uphill_deg", "degrees"),
    ):
        table.add_row(what, fixed(before[name], 1), fixed(after[name], 1), unit)
    return table
