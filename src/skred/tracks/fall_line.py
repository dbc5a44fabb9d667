"""The line of steepest descent from a place, as water would go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from skred.arrays import FloatArray
from skred.tracks.plan import Plan

STEP = 0.25
"""Length of a step, in cells."""
FLATTEST = 1e-3
"""Ground of less slope (0.06 degrees) has no direction to follow."""
SHARPEST_TURN_DEG = 45.0
"""A turn between line and extension that is told of is sharper."""
PIT = 3.0
"""Where a line of so many cells leads neither lower nor away, it is in a pit.

Lower alone will not do: bilinear elevations rise and fall along a gully that runs crosswise to the raster.
"""
MOST_STEPS = 200_000
_SHARPEST_STEP = 0.866
"""Cosine of 30 degrees: a step along which the direction changes by more is halved."""
_HALVINGS = 4


class Surface(Protocol):
    """Terrain with a slope."""

    def heights(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Elevation [m] at places; NaN where there is none."""

    def gradient(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the elevation by x and y; NaN where there are none."""


@dataclass(frozen=True, eq=False)
class FallLine:
    """A line of steepest descent.

    Attributes
    ----------
    plan : Plan
        From where it starts; one point where it could not.
    stopped : str or None
        Why it is shorter than was asked for; None where it is not.
    """

    plan: Plan
    stopped: str | None


def fall_line(surface: Surface, x: float, y: float, length_m: float, cell_m: float) -> FallLine:
    """Go down the steepest way, by the midpoint rule.

    Parameters
    ----------
    surface : Surface
    x, y : float, m
        Where to start.
    length_m : float, m
        Horizontal length to go.
    cell_m : float, m
        Length of the terrain's cells; steps are a quarter of it.

    Returns
    -------
    FallLine
        Ends early in a pit, on flat ground, and within a cell of where there is no data.
    """
    points, gone = [np.array([x, y])], [0.0]
    lowest, lowest_m = 0, _height(surface, points[0])
    stopped = None
    while (left := length_m - gone[-1]) > 1e-9 * cell_m:
        if len(points) > MOST_STEPS:
            stopped = f"{MOST_STEPS} steps"
            break
        following = _next(surface, points[-1], min(STEP * cell_m, left))
        if isinstance(following, str):
            stopped = following
            break
        gone.append(gone[-1] + float(np.hypot(*(following - points[-1]))))
        points.append(following)
        height = _height(surface, following)
        if height < lowest_m:
            lowest, lowest_m = len(points) - 1, height
        elif gone[-1] - gone[lowest] > PIT * cell_m and _stays(points[lowest:], PIT * cell_m):
            points, stopped = points[: lowest + 1], "a pit"
            break
    along = np.array(points)
    if stopped is not None:
        end_m = _height(surface, along[-1])
        stopped += f" at ({along[-1, 0]:.1f}, {along[-1, 1]:.1f}), {end_m:.1f} m above sea level"
    return FallLine(Plan(along[:, 0], along[:, 1]), stopped)


def turn_notice(above: Plan, extension: Plan, cell_m: float) -> list[str]:
    """Tell of an extension that turns away from the line that it goes on with.

    Parameters
    ----------
    above, extension : Plan
        The line, and what begins at its end.
    cell_m : float, m
        Length of the terrain's cells; directions are those over five of them.
    """
    reach = 5.0 * cell_m
    if extension.length == 0.0:
        return []
    last, first = above.turned().up_to(reach), extension.up_to(reach)
    before = np.arctan2(last.y[0] - last.y[-1], last.x[0] - last.x[-1])
    after = np.arctan2(first.y[-1] - first.y[0], first.x[-1] - first.x[0])
    turn = float(np.degrees(np.abs((after - before + np.pi) % (2.0 * np.pi) - np.pi)))
    if turn < SHARPEST_TURN_DEG:
        return []
    return [
        f"the fall line leaves the end of the line at {turn:.0f} degrees: an avalanche would hardly turn so; "
        "let the line end where the valley begins, or do without --extend"
    ]


def _stays(points: Sequence[FloatArray], length_m: float) -> bool:
    """Whether the end of a line has not come away from where it was `length_m` before."""
    last = points[-1]
    gone = 0.0
    for after, before in zip(points[:0:-1], points[-2::-1], strict=True):
        gone += float(np.hypot(*(after - before)))
        if gone >= length_m:
            return float(np.hypot(*(last - before))) < 0.5 * length_m
    return True


def _next(surface: Surface, place: FloatArray, step: float) -> FloatArray | str:
    """The next point, or why there is none."""
    first = _downhill(surface, place)
    if isinstance(first, str):
        return first
    for _ in range(_HALVINGS + 1):
        middle = _downhill(surface, place + 0.5 * step * first)
        if isinstance(middle, str):
            return middle
        following = place + step * middle
        if first @ middle > _SHARPEST_STEP:
            break
        step *= 0.5
    return following if np.isfinite(_height(surface, following)) else "no data beyond"


def _downhill(surface: Surface, place: FloatArray) -> FloatArray | str:
    """Direction of steepest descent, of length 1, or why there is none."""
    by_x, by_y = (float(part[0]) for part in surface.gradient(place[:1], place[1:]))
    slope = np.hypot(by_x, by_y)
    if not np.isfinite(slope):
        return "no data beyond"
    if slope < FLATTEST:
        return "flat ground"
    return -np.array([by_x, by_y]) / slope


def _height(surface: Surface, place: FloatArray) -> float:
    return float(surface.heights(place[:1], place[1:])[0])
