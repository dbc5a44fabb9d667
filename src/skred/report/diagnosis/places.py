"""Figures of a diagnosis along the track: where something is missing, and the evidence against place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.diagnosis.words import (
    MISMATCH,
    blamed_sensors,
    colour_of,
    leading,
    profile_of,
    short_title,
    stretch_of,
)
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.style import GREY, INK, PALE, legend_below, new_figure, styled, tint
from skred.report.shared.track_panels import placed_sensors, terrain_profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.diagnosis.compare.candidate import Candidate
    from skred.diagnosis.compare.comparison import Comparison
    from skred.diagnosis.compare.location import Location
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.physics.mechanisms.spec import Shape
    from skred.report.diagnosis.flat import Flat as Diagnosis

_LOCAL = ("obstacle", "segment_drag", "segment_friction", "sensor_bias")
_DEPTH = 40.0
"""How far below its highest evidence is shown; what is below stands at the edge [nats]."""


@styled
def where_figure(found: Diagnosis) -> Figure:
    """The track with its sensors and the mismatch, the missing retardation, and what came by."""
    problem, profile = found.problem, profile_of(found)
    alarm = found.location is not None
    what = "Where something is missing" if alarm else "No alarm: the missing force along the track"
    title = f"{what}\n{figure_text(found.law.title, 80)}"
    ratios = [1.1, 1.5, 0.75] if profile is not None else [1.0]
    figure = new_figure(6.6 if profile is not None else 3.2, title)
    panels = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios).ravel()
    window = _window(found, profile)
    terrain_profile(panels[0], problem, window, named=True)
    _blamed(panels[0], found)
    panels[0].set_ylabel("elevation [m]")
    _elevations(panels[0], problem, window)
    if profile is not None:
        _retardation(panels[1], profile)
        _covered(panels[2], profile)
    for axes in panels:
        _marks(axes, found)
    panels[0].set_xlim(*window)
    panels[-1].set_xlabel("s along the track [m], the part with recordings")
    legend_below(figure, panels, columns=2)
    return figure


def _window(found: Diagnosis, profile: Location | None, shapes: Sequence[Shape] = ()) -> tuple[float, float]:
    """The part with recordings, and a little more."""
    from skred.diagnosis.evidence.extension import recorded_range

    low, high = recorded_range(found.problem)
    ends = [low, high, *(stretch_of(found) or ())]
    ends += [end for shape in shapes for end in (shape.s_from_m, shape.s_to_m) if end is not None]
    if profile is not None:
        ends += [float(profile.s_m[0]), float(profile.s_m[-1])]
    margin = 0.05 * (max(ends) - min(ends))
    return max(min(ends) - margin, 0.0), min(max(ends) + margin, found.problem.terrain.length_m)


def _elevations(axes: Axes, problem: HierarchicalProblem, window: tuple[float, float]) -> None:
    """Limit the elevations to those of the part that is shown."""
    track = problem.campaign.track
    s_m, z_m = np.asarray(track.s_m), np.asarray(track.z_m)
    inside = z_m[(s_m >= window[0]) & (s_m <= window[1])]
    z = np.concatenate([inside, np.interp(window, s_m, z_m)])
    margin = 0.08 * (float(np.ptp(z)) or 1.0)
    axes.set_ylim(z.min() - margin, z.max() + margin)


def _marks(axes: Axes, found: Diagnosis) -> None:
    """The stretch that the verdict names, and the campaign's reference."""
    stretch, reference = stretch_of(found), found.problem.campaign.reference_s_m
    if stretch is not None:
        label = f"what is missing: s = {stretch[0]:.0f} to {stretch[1]:.0f} m"
        axes.axvspan(*stretch, color=MISMATCH, alpha=0.18, linewidth=0, label=label, zorder=0)
    for step in found.steps[1:]:
        second = step.candidate.stretch()
        if second is not None:
            label = f"the second: s = {second[0]:.0f} to {second[1]:.0f} m"
            axes.axvspan(*second, color="#E69F00", alpha=0.25, linewidth=0, label=label, zorder=0)
    if reference is not None:
        label = f"reference, s = {reference:.0f} m"
        axes.axvline(reference, color=GREY, linewidth=0.9, linestyle="--", label=label)


def _blamed(axes: Axes, found: Diagnosis) -> None:
    """Sensors that the verdict blames."""
    track, label = found.problem.campaign.track, "sensor that reads wrongly"
    for _, sensor, middle in placed_sensors(found.problem):
        if sensor.id in blamed_sensors(found):
            z = float(np.interp(middle, track.s_m, track.z_m))
            axes.plot(
                middle, z, marker="o", markersize=11, markeredgewidth=1.8, markerfacecolor="none",
                color=MISMATCH, linestyle="none", label=label,
            )  # fmt: skip


def _retardation(axes: Axes, profile: Location) -> None:
    colour = colour_of("unlisted")
    band = tint(colour, 0.35)
    axes.fill_between(
        profile.s_m, profile.low, profile.high, color=band, linewidth=0,
        label="holds the whole profile with probability 0.9",
    )  # fmt: skip
    axes.plot(profile.s_m, profile.mean, color=INK, linewidth=1.4, label="missing retardation, mean")
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    what = "missing retardation\nof a fast front" if profile.opposed else "missing retardation\n"
    axes.set_ylabel(f"{what} [{unit_text('m s-2')}],\npositive brakes")
    axes.grid(axis="y")
    # The stretch that the profile can tell apart.
    low, high = axes.get_ylim()
    start = float(profile.s_m[0])
    width = min(profile.resolution_m, float(np.ptp(profile.s_m)))
    axes.set_ylim(low - 0.16 * (high - low), high)
    level = low - 0.05 * (high - low)
    axes.errorbar(
        start + 0.5 * width, level, xerr=0.5 * width, color=INK, capsize=3, linewidth=1.2,
        label=f"resolution, {profile.resolution_m:.0f} m",
    )  # fmt: skip


def _covered(axes: Axes, profile: Location) -> None:
    axes.fill_between(profile.s_m, 0.0, 100.0 * profile.covered, color=PALE, linewidth=0)
    axes.plot(profile.s_m, 100.0 * profile.covered, color=GREY, linewidth=1.0)
    axes.set_ylim(0.0, 108.0)
    axes.set_yticks([0, 50, 100])
    axes.set_ylabel("avalanches that\ncame by [%]")


def local_names(comparison: Comparison) -> list[str]:
    """Mechanisms of one place, or of one sensor, in a comparison."""
    return [
        name
        for name in _LOCAL
        if any(name in under_errors.candidates for under_errors in comparison.under_each)
    ]


@styled
def places_figure(found: Diagnosis, comparison: Comparison, number: int) -> Figure:
    """Log Bayes factor of each local mechanism at each place."""
    names = local_names(comparison)
    which = " given the first finding" if number else ""
    title = f"Evidence against place{which}\nEach bar or point: one place, for all strengths together"
    figure = new_figure(1.2 + 1.35 * len(names), title)
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False).ravel()
    window = _window(found, None, [leading(comparison, name).best.shape for name in names])
    middles = {sensor.id: sensor for _, sensor, _ in placed_sensors(found.problem)}
    for axes, name in zip(panels, names, strict=True):
        _at_places(axes, leading(comparison, name), middles)
        axes.set_title(figure_text(short_title(name), 70), fontsize=8.5)
        for _, _, middle in placed_sensors(found.problem):
            axes.axvline(middle, ymin=0.94, color=INK, linewidth=0.8, label="sensors of speed")
        reference = found.problem.campaign.reference_s_m
        if reference is not None:
            axes.axvline(
                reference,
                color=GREY,
                linewidth=0.9,
                linestyle="--",
                label=f"reference, s = {reference:.0f} m",
            )
    panels[0].set_xlim(*window)
    figure.supylabel("log Bayes factor against nothing [nats]", fontsize=8.5)
    panels[-1].set_xlabel("s along the track [m]")
    legend_below(figure, panels, columns=2)
    return figure


def _at_places(axes: Axes, candidate: Candidate, sensors: dict[str, Any]) -> None:
    colour = colour_of(candidate.mechanism.id)
    factors = np.array([one.log_bayes_factor for one in candidate.curves])
    top = max(float(factors.max()), 0.0)
    floor = min(top, max(float(factors.min()), -3.0, top - _DEPTH)) - 1.0
    for one, factor in zip(candidate.curves, np.maximum(factors, floor), strict=True):
        shape, best = one.shape, one is candidate.best
        shade = MISMATCH if best else tint(colour, 0.55)
        ends = (shape.s_from_m, shape.s_to_m)
        if shape.sensor is not None and shape.sensor in sensors:
            ends = sensors[shape.sensor].s_from_m, sensors[shape.sensor].s_to_m
        first, last = ends
        if first is None or last is None:
            continue
        order = 4 if best else 2
        label = "highest" if best else "_other"
        axes.hlines(
            factor, first, last, color=shade, linewidth=2.6 if best else 1.2, zorder=order, label=label
        )
        if shape.sensor is not None or candidate.mechanism.id == "obstacle":
            axes.plot(0.5 * (first + last), factor, marker="o", markersize=4, color=shade, zorder=order)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylim(floor - 0.5, top + max(1.0, 0.12 * (top - floor)))
    axes.grid(axis="y")
