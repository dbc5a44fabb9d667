"""Elevations along a line: sampled, turned downhill, smoothed, and what the smoothing costs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.campaign.track_rules import STEEPEST_DEG
from skred.errors import InputError
from skred.physics.terrain import SMOOTHING_M, USUAL_PATH_M, default_smoothing, smoothed_slopes
from skred.tracks.elevations import Elevations
from skred.tracks.plan import Plan

_SHOWN_STRETCHES = 3
_STEP = 0.1
"""Length of the stretches by which slopes are averaged, in smoothing lengths."""
_MOST_STEPS = 1_000_000
MOST_SMOOTHED_M = 5.0
"""Smoothing behind which a hole of the terrain model still has edges."""
_RISES_M = 0.5
"""A rise that is told of is higher."""


def sampled(elevations: Elevations, plan: Plan) -> FloatArray:
    """Elevation of the terrain at the points of a line [m].

    Raises
    ------
    InputError
        If some points lie off the raster or where it has no data; each stretch with its coordinates.
    """
    z = elevations.heights(plan.x, plan.y)
    bad = ~np.isfinite(z)
    if not bad.any():
        return z
    off = ~elevations.contains(plan.x, plan.y)
    stretches = list(_stretches(bad, off, plan))
    shown = stretches[:_SHOWN_STRETCHES]
    if len(stretches) > len(shown):
        shown.append(f"and {len(stretches) - len(shown)} stretches more")
    left, low, right, high = elevations.bounds
    covers = f"the raster covers x {left:.1f} to {right:.1f}, y {low:.1f} to {high:.1f}"
    raise InputError(
        f"{elevations.file}: no elevation at {bad.sum()} of {len(bad)} points of the line: "
        f"{'; '.join(shown)}; {covers}. Move or shorten the line, or take a terrain model that covers it"
    )


def _stretches(bad: BoolArray, off: BoolArray, plan: Plan) -> Iterator[str]:
    """Stretches without elevations in words, in the order of the line."""
    along = plan.along
    kind = np.where(bad, np.where(off, 2, 1), 0)
    starts = np.flatnonzero(np.diff(kind, prepend=0) != 0)
    for start, end in zip(starts, [*starts[1:], len(kind)], strict=True):
        if kind[start] == 0:
            continue
        last = end - 1
        what = "off the raster" if kind[start] == 2 else "no data"
        places = [f"({plan.x[k]:.1f}, {plan.y[k]:.1f})" for k in (start, last)]
        if start == last:
            yield f"{what} at {places[0]}, {along[start]:.0f} m along the line"
        else:
            ends = f"{along[start]:.0f} to {along[last]:.0f} m along the line"
            yield f"{what} from {places[0]} to {places[1]}, {ends}"


def require_ground(
    elevations: Elevations, along: FloatArray, points: Plan, z: FloatArray, smoothing_m: float
) -> None:
    """Refuse steps that no command reads as a track: mostly edges of holes that the file does not declare.

    Parameters
    ----------
    elevations : Elevations
    along : (n,) array, m
        Horizontal distance.
    points : Plan
        The track's points.
    z : (n,) array, m
        Elevations there, as sampled.
    smoothing_m : float
        Of what is written. Steps are looked for after at most `MOST_SMOOTHED_M`, because more makes a gentle
        dale of a hole.

    Raises
    ------
    InputError
        If a stretch is steeper than a track may be; with its coordinates.
    """
    ground = smoothed(along, z, min(smoothing_m, MOST_SMOOTHED_M))
    degrees = np.degrees(np.abs(np.arctan2(np.diff(ground), np.diff(along))))
    k = int(degrees.argmax())
    if degrees[k] <= STEEPEST_DEG:
        return
    start, end = max(0, k - 1), min(len(z) - 1, k + 2)  # an edge may lie between two points
    places = " and ".join(f"({points.x[i]:.1f}, {points.y[i]:.1f})" for i in (start, end))
    cliff = "lay the line beside it" + (", or smooth more" if smoothing_m < MOST_SMOOTHED_M else "")
    raise InputError(
        f"{elevations.file}: the ground goes from {z[start]:.1f} to {z[end]:.1f} m between {places}, "
        f"{along[k]:.0f} m along the track, at up to {degrees[k]:.1f} degrees; expected at most "
        f"{STEEPEST_DEG:g}. Are there cells without data that the file does not declare, such as 0? Declare "
        f"them (rio edit-info {elevations.file.name} --nodata 0), and fill them or move the line. At a "
        f"cliff, {cliff}"
    )


def goes_uphill(z: FloatArray) -> bool:
    """Whether a line has to be turned.

    Parameters
    ----------
    z : (n,) array, m
        Elevations along it.

    Raises
    ------
    InputError
        If it has no fall.
    """
    if z[0] == z[-1]:
        raise InputError(f"the line begins and ends at the same elevation, {z[0]:.1f} m; draw it downhill")
    return bool(z[0] < z[-1])


def rise_notice(s_m: FloatArray, z: FloatArray) -> list[str]:
    """Tell of the highest rise on the way down, if there is one to speak of.

    Parameters
    ----------
    s_m : (n,) array, m
        Arc length.
    z : (n,) array, m
        Elevations, downhill as a whole.
    """
    rise = z - np.minimum.accumulate(z)
    top = int(rise.argmax())
    if rise[top] < _RISES_M:
        return []
    foot = int(z[: top + 1].argmin())
    return [
        f"the track rises by {rise[top]:.1f} m from s = {s_m[foot]:.0f} to {s_m[top]:.0f} m: a dam, a "
        "counter-slope, or a line that leaves the gully"
    ]


@dataclass(frozen=True)
class Shape:
    """What a profile amounts to.

    Attributes
    ----------
    fall_m : float
        Elevation of the first point above the last [m].
    length_m : float
        Arc length, following the slope [m].
    steepest_deg : float
        Largest slope angle between neighbouring points, downhill [degrees].
    steepest_uphill_deg : float
        The same uphill; 0 where it only falls.
    """

    fall_m: float
    length_m: float
    steepest_deg: float
    steepest_uphill_deg: float


def shape(along: FloatArray, z: FloatArray) -> Shape:
    """What a profile amounts to.

    Parameters
    ----------
    along, z : (n,) array, m
        Horizontal distance and elevation.
    """
    dx, dz = np.diff(along), np.diff(z)
    slope = np.degrees(np.arctan2(-dz, dx))
    steepest, uphill = float(slope.max()), max(0.0, float(-slope.min()))
    return Shape(float(z[0] - z[-1]), float(np.hypot(dx, dz).sum()), steepest, uphill)


def smoothed(along: FloatArray, z: FloatArray, smoothing_m: float) -> FloatArray:
    """Elevations averaged with the weights of `skred.physics.terrain.smoothed_slopes`.

    Parameters
    ----------
    along, z : (n,) array, m
        Distance along which they are averaged, from 0, and elevation. A track that is written is smoothed
        over horizontal distance, so that its points stay where they are on the map; commands that read it
        smooth along the arc length.
    smoothing_m : float, m
        Waves of ``2 pi smoothing_m`` lose half their height; 0 changes nothing.
    """
    if smoothing_m == 0.0:
        return z.copy()
    n = int(np.clip(along[-1] / (_STEP * smoothing_m), len(along), _MOST_STEPS))
    edges = np.linspace(0.0, along[-1], n + 1)
    falls = smoothed_slopes(along, z, smoothing_m, n) * np.diff(edges)
    return np.asarray(z[0] - np.interp(along, edges, np.append(0.0, np.cumsum(falls))), dtype=float)


def smoothed_twice_as_m(first_m: float, second_m: float) -> float:
    """Length of the one smoothing [m] that does what two do one after the other, on gentle ground.

    Both average with Gaussian weights, whose variances add.
    """
    return math.hypot(first_m, second_m)


def short_notice(length_m: float) -> list[str]:
    """That a track is too short for the smoothing of a path, and what becomes of it then.

    Parameters
    ----------
    length_m : float
        Along the slope.
    """
    if length_m >= USUAL_PATH_M:
        return []
    refused = f" and `skred predict --track` refuses it: its smoothing of {SMOOTHING_M:g} m is longer"
    return [
        f"the track is only {length_m:.3g} m long: commands that read it smooth it by"
        f" {default_smoothing(length_m):.2g} m instead of {SMOOTHING_M:g},"
        f"{refused if length_m < SMOOTHING_M else ' and a law calibrated on a longer one smooths it more'};"
        " check that the line is the whole path, in metres"
    ]
