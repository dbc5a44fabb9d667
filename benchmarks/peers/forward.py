"""The forward model of M2 as array expressions, for any library with numpy's functions.

The same cells, closed-form step, stop inside a cell, switch of the normal force and reading at the
sensors as skred's kernel, written with `where` instead of branches: what one writes in
`pytensor.scan` or `jax.lax.scan`. The library comes in as `xp` (`pytensor.tensor` or `jax.numpy`).
Every `where` guards the side it does not take, so that reverse-mode derivatives stay finite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.inference.pooled.problem import PooledProblem
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.inputs import RUNOUT

FloatArray = NDArray[np.float64]
_NEVER = 1e30
"""Threshold of a concave cell [m2 s-2]: its normal force never vanishes."""
_SHORT_SERIES = 1e-4
"""Exponent below which three terms of the series reach double precision."""


@dataclass(frozen=True)
class Track:
    """The cells from the release on, and the sensors.

    Attributes
    ----------
    release : float, m
    cells : (5, n_cells) array
        Length [m], sine and cosine of the slope, curvature [1/m], threshold of v [m2 s-2].
    n_speeds : int
        Speed sensors; the runout follows them.
    places : (n_speeds,) array, m
    sensor_cell : (n_speeds,) integer array
        Cell that holds each speed sensor.
    sensor_cells : (5, n_speeds) array
        As `cells`, its length the way from the cell's upper edge to the sensor.
    """

    release: float
    cells: FloatArray
    n_speeds: int
    places: FloatArray
    sensor_cell: NDArray[np.int64]
    sensor_cells: FloatArray


def track_of(problem: PooledProblem) -> Track:
    """Track of a problem.

    Raises
    ------
    ValueError
        If the campaign needs more than these peers know: several release places, dams, speeds
        over a span, or other sensors than speeds followed by one runout.
    """
    path, sensors = problem.path, problem.sensors
    points, runout = sensors[:-1], sensors[-1]
    one = len(problem.releases) == 1 and not problem.release_speeds.any()
    if not one or len(path.barriers) or runout[0] != RUNOUT:
        raise ValueError("the peers know one release from rest, no dams, and a runout as the last sensor")
    if np.any(points[:, 0] == RUNOUT) or np.any(points[:, 1] != points[:, 2]):
        raise ValueError("the peers know speeds at points only")
    release = float(problem.releases[0])
    first = int(np.searchsorted(path.edge, release, side="right")) - 1
    edge = np.concatenate([[release], path.edge[first + 1 :]])
    sine, cosine, kappa = path.ground[:, first:]
    convex = kappa < 0.0
    threshold = np.where(convex, -GRAVITY * cosine / np.where(convex, kappa, 1.0), _NEVER)
    cells = np.array([np.diff(edge), sine, cosine, kappa, threshold])
    places = points[:, 1]
    sensor_cell = np.searchsorted(edge, places, side="right") - 1
    sensor_cells = cells[:, sensor_cell].copy()
    sensor_cells[0] = places - edge[sensor_cell]
    return Track(release, cells, len(points), places, sensor_cell, sensor_cells)


def _phi1(xp: Any, x: Any) -> Any:
    """(1 - exp(-x)) / x."""
    small = xp.abs(x) < _SHORT_SERIES
    divisor = xp.where(small, 1.0, x)
    return xp.where(small, 1.0 - x * (0.5 - x / 6.0), -xp.expm1(-divisor) / divisor)


def _distance_to(xp: Any, target: Any, v: Any, a: Any, b: Any, wanted: Any) -> Any:
    """Distance [m] at which dv/ds = a - b v carries v to the target, where it is wanted; else 0."""
    rate = xp.where(wanted, a - b * v, 1.0)
    straight = xp.where(wanted, (target - v) / rate, 0.0)
    small = xp.abs(b * straight) < 1e-8
    y = xp.where(small, 0.0, b * straight)
    divisor = xp.where(small, 1.0, b)
    return xp.where(small, straight * (1.0 + 0.5 * b * straight), -xp.log1p(-y) / divisor)


def cross(xp: Any, v: Any, cell: Any, mu: Any, drag: Any) -> tuple[Any, Any]:
    """Carry a front through one cell, or several fronts each through its own.

    Parameters
    ----------
    xp : module
    v : scalar or array, m2 s-2
        Squared front speed at the start.
    cell : sequence of five
        As a column of `Track.cells`.
    mu, drag : scalar; -, 1/m

    Returns
    -------
    v, distance
        Squared speed at the end, 0 where the front stops, and the distance covered [m].
    """
    length, sine, cosine, kappa, threshold = cell
    on = GRAVITY * cosine + kappa * v >= 0.0
    friction = xp.where(on, mu, 0.0)
    a = 2.0 * GRAVITY * (sine - friction * cosine)
    b = 2.0 * (drag + friction * kappa)
    end = v - (b * v - a) * length * _phi1(xp, b * length)
    stops = end <= 0.0
    switches = xp.where(on, end > threshold, (end < threshold) & ~stops)
    ended = stops | switches
    target = xp.where(switches, threshold, 0.0)
    covered = xp.where(ended, xp.minimum(_distance_to(xp, target, v, a, b, ended), length), length)
    # The second phase can neither switch back, v being monotone in a cell, nor stop: the speeds at
    # which a snow-covered slope lets go of a front are far too high for that.
    friction = xp.where(on, 0.0, mu)
    a = 2.0 * GRAVITY * (sine - friction * cosine)
    b = 2.0 * (drag + friction * kappa)
    rest = length - covered
    beyond = threshold - (b * threshold - a) * rest * _phi1(xp, b * rest)
    v = xp.where(stops, 0.0, xp.where(switches, beyond, end))
    return v, xp.where(switches, length, covered)


def march_step(xp: Any, v: Any, s: Any, cell: Any, mu: Any, drag: Any) -> tuple[Any, Any]:
    """One cell of the march: (v, s) at its lower edge; a front that has stopped stays."""
    moving = v > 0.0
    end, distance = cross(xp, v, cell, mu, drag)
    return xp.where(moving, end, 0.0), xp.where(moving, s + distance, s)


def read(xp: Any, track: Track, v_above: Any, runout: Any, mu: Any, drag: Any) -> Any:
    """Readings: speeds at the sensors, 0 where the front does not come, and the runout.

    Parameters
    ----------
    v_above : (n_speeds,) array
        v at the upper edge of each sensor's cell.
    """
    end, _ = cross(xp, v_above, tuple(track.sensor_cells), mu, drag)
    reached = (track.places < runout) & (end > 0.0)
    return xp.where(reached, xp.sqrt(xp.where(reached, end, 1.0)), 0.0)
