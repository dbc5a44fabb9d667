"""Terrain as the kernel sees it: cells along the track with slope and curvature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SMOOTHING_M = 10.0
"""Default smoothing length [m] of a usual path; results of laws with curvature depend on it."""
CELL_M = 6.0
"""Default largest length of a cell [m] of a usual path."""
USUAL_PATH_M = 600.0
"""Length of a track [m] below which both become shorter in proportion, down to a chute in a laboratory."""
MAX_CELLS = 100_000


@dataclass(frozen=True, eq=False)
class Terrain:
    """A track cut into cells; slope and curvature are constant within one.

    Attributes
    ----------
    edge_s_m : (n_cells + 1,) array, m
        Arc length at the cell edges, increasing.
    sin_slope, cos_slope : (n_cells,) array
        Sine and cosine of the slope angle phi, downhill positive.
    curvature : (n_cells,) array, 1/m
        kappa = -d(phi)/ds, positive where the track is concave.
    smoothing_m : float, m
        Smoothing length the terrain was made with (NaN where none was used).

    """

    edge_s_m: FloatArray
    sin_slope: FloatArray
    cos_slope: FloatArray
    curvature: FloatArray
    smoothing_m: float = float("nan")

    def __post_init__(self) -> None:
        """Check shapes and freeze the arrays."""
        n_cells = len(self.edge_s_m) - 1
        for name in ("edge_s_m", "sin_slope", "cos_slope", "curvature"):
            array = np.array(getattr(self, name), dtype=float)
            expected = n_cells + 1 if name == "edge_s_m" else n_cells
            if array.shape != (expected,) or not np.all(np.isfinite(array)):
                raise ValueError(f"{name}: expected {expected} finite values, found {array.shape}")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if n_cells < 1 or np.any(np.diff(self.edge_s_m) <= 0):
            raise ValueError("edge_s_m must hold at least two increasing values")

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.sin_slope)

    @property
    def length_m(self) -> float:
        """Arc length of the track's lower end [m]."""
        return float(self.edge_s_m[-1])

    @property
    def slope_rad(self) -> FloatArray:
        """Slope angle phi per cell [rad], downhill positive."""
        return np.arctan2(self.sin_slope, self.cos_slope)


def default_smoothing(length_m: float) -> float:
    """Smoothing length [m] of a track of that length: 10 m, and in proportion less below 600 m."""
    return SMOOTHING_M * min(1.0, float(length_m) / USUAL_PATH_M)


def default_cell(length_m: float) -> float:
    """Largest length of a cell [m] on a track of that length: 6 m, and in proportion less below 600 m."""
    return CELL_M * min(1.0, float(length_m) / USUAL_PATH_M)


def build_terrain(
    x_m: FloatArray,
    z_m: FloatArray,
    *,
    smoothing_m: float | None = None,
    cell_m: float | None = None,
) -> Terrain:
    """Terrain from a surveyed track by one cubic smoothing spline z(x).

    The penalty is chosen so that undulations of wavelength ``2 pi smoothing_m`` lose half their
    amplitude. Drop and angle change of every cell are taken from the spline's values and slopes
    at the cell's edges, so the fall of potential energy along the track is exact.

    Parameters
    ----------
    x_m, z_m : (n_points,) array, m
        Horizontal distance (strictly increasing) and elevation, at least three points.
    smoothing_m : float, m, optional
        Smoothing length; 0 interpolates. By default `default_smoothing`.
    cell_m : float, m, optional
        Largest length of a cell. By default `default_cell`.

    Returns
    -------
    Terrain
        Its ``s`` is the arc length of the given polyline, as in a campaign.

    Raises
    ------
    ValueError
        If a length is not positive or the track would need more than 100 000 cells.

    """
    polyline_s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x_m), np.diff(z_m)))])
    smoothing_m = default_smoothing(polyline_s[-1]) if smoothing_m is None else smoothing_m
    cell_m = default_cell(polyline_s[-1]) if cell_m is None else cell_m
    if not (cell_m > 0 and smoothing_m >= 0):
        raise ValueError("cell_m must be positive and smoothing_m not negative")
    n_cells = int(np.ceil(polyline_s[-1] / cell_m))
    if n_cells > MAX_CELLS:
        raise ValueError(f"the track needs {n_cells} cells of {cell_m} m; choose longer cells")
    edge_s = np.linspace(0.0, polyline_s[-1], n_cells + 1)
    edge_x = np.interp(edge_s, polyline_s, x_m)
    spline, derivative = smoothing_spline(np.asarray(x_m, float), np.asarray(z_m, float), smoothing_m)
    elevation, gradient = spline(edge_x), derivative(edge_x)
    length = np.diff(edge_s)
    sin_slope = np.clip(-np.diff(elevation) / length, -1.0, 1.0)
    return Terrain(
        edge_s_m=edge_s,
        sin_slope=sin_slope,
        cos_slope=np.sqrt(1.0 - sin_slope**2),
        curvature=np.diff(np.arctan(gradient)) / length,
        smoothing_m=smoothing_m,
    )


def smoothing_spline(
    x: FloatArray, z: FloatArray, smoothing_m: float
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Natural cubic spline minimising sum (z - f)^2 + smoothing^4 / spacing * int f''^2, and f'.

    Parameters
    ----------
    x, z : (n_points,) array, m
        Horizontal distance (strictly increasing) and elevation.
    smoothing_m : float, m
        Undulations of wavelength ``2 pi smoothing_m`` lose half their amplitude; 0 interpolates.
    """
    # Here, because laws and their command lines import this module and scipy takes half a second.
    from scipy.interpolate import make_smoothing_spline

    if len(x) < 5:
        # The penalised spline needs five points; a campaign may have three.
        dense = np.linspace(x[0], x[-1], 5)
        x, z = dense, np.interp(dense, x, z)
    spacing = float(np.mean(np.diff(x)))
    spline = make_smoothing_spline(x, z, lam=smoothing_m**4 / spacing)
    return spline, spline.derivative()
