"""Terrain as the kernel sees it: cells along the track with slope and curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import FloatArray
from skred.errors import InputError

SMOOTHING_M = 10.0
"""Default smoothing length [m] of a usual path; results of laws with curvature depend on it."""
CELL_M = 6.0
"""Default largest length of a cell [m] of a usual path."""
USUAL_PATH_M = 600.0
"""Length of a track [m] below which both become shorter in proportion, down to a chute in a laboratory."""
MAX_CELLS = 100_000
SD_PER_SMOOTHING = float(np.sqrt(2.0 * np.log(2.0)))
"""Standard deviation of the Gaussian weights, by which a wave of ``2 pi`` smoothing lengths is halved."""
PARTS_PER_SD, MOST_PARTS = 8, 16
"""Into so many stretches a standard deviation of the weights, and at most a cell, is cut to be averaged."""


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
    def middle_s_m(self) -> FloatArray:
        """Arc length at the middles of the cells [m], (n_cells,)."""
        middle: FloatArray = 0.5 * (self.edge_s_m[1:] + self.edge_s_m[:-1])
        return middle

    def share_between(self, s_from_m: float, s_to_m: float) -> FloatArray:
        """Share of each cell that lies between two places [m], (n_cells,)."""
        overlap = np.minimum(self.edge_s_m[1:], s_to_m) - np.maximum(self.edge_s_m[:-1], s_from_m)
        share: FloatArray = np.clip(overlap / np.diff(self.edge_s_m), 0.0, 1.0)
        return share

    @property
    def slope_rad(self) -> FloatArray:
        """Slope angle phi per cell [rad], downhill positive."""
        return np.arctan2(self.sin_slope, self.cos_slope)

    def continued_up(self, first_m: float) -> Terrain:
        """With its first slope going on above its first point, to a negative place [m] or just beyond."""
        cell = float(self.edge_s_m[1] - self.edge_s_m[0])
        n = max(int(np.ceil((float(self.edge_s_m[0]) - first_m) / cell - 1e-9)), 0)
        above = float(self.edge_s_m[0]) - cell * np.arange(n, 0, -1)
        return Terrain(
            np.concatenate([above, self.edge_s_m]),
            np.concatenate([np.full(n, self.sin_slope[0]), self.sin_slope]),
            np.concatenate([np.full(n, self.cos_slope[0]), self.cos_slope]),
            np.concatenate([np.zeros(n), self.curvature]),
            self.smoothing_m,
        )


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
    """Terrain from a surveyed track, smoothed along its arc length.

    The slope of the polyline is averaged with Gaussian weights (`smoothed_slopes`). Nothing overshoots: the
    smoothed slope lies within the surveyed ones nearby, ground that only falls still does, and length and
    fall of the whole track are kept.

    Parameters
    ----------
    x_m, z_m : (n_points,) array, m
        Horizontal distance (strictly increasing) and elevation, at least three points.
    smoothing_m : float, m, optional
        Smoothing length: undulations of wavelength ``2 pi smoothing_m`` lose half their amplitude; 0 leaves
        the polyline as it is. By default `default_smoothing`.
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
    InputError
        If the smoothing length is longer than the track.

    """
    polyline_s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x_m), np.diff(z_m)))])
    smoothing_m = default_smoothing(polyline_s[-1]) if smoothing_m is None else smoothing_m
    cell_m = default_cell(polyline_s[-1]) if cell_m is None else cell_m
    if not (cell_m > 0 and smoothing_m >= 0):
        raise ValueError("cell_m must be positive and smoothing_m not negative")
    n_cells = int(np.ceil(polyline_s[-1] / cell_m))
    if n_cells > MAX_CELLS:
        raise ValueError(f"the track needs {n_cells} cells of {cell_m} m; choose longer cells")
    length, sd_m = polyline_s[-1] / n_cells, smoothing_m * SD_PER_SMOOTHING
    # Edges of cells are edges of the stretches, so that a cell's mean slope is exact.
    parts = 1 if sd_m == 0 else int(np.clip(np.ceil(PARTS_PER_SD * length / sd_m), 1, MOST_PARTS))
    sines = smoothed_slopes(polyline_s, np.asarray(z_m, float), smoothing_m, n_cells * parts)
    sines = np.clip(sines, -1.0, 1.0)
    sin_slope = sines.reshape(n_cells, parts).mean(axis=1)
    before, after = np.append(sines[0], sines), np.append(sines, sines[-1])
    at_edges = np.arcsin(0.5 * (before + after))[::parts]
    return Terrain(
        edge_s_m=np.linspace(0.0, polyline_s[-1], n_cells + 1),
        sin_slope=sin_slope,
        cos_slope=np.sqrt(1.0 - sin_slope**2),
        curvature=-np.diff(at_edges) / length,
        smoothing_m=smoothing_m,
    )


def smoothed_slopes(along_m: FloatArray, z_m: FloatArray, smoothing_m: float, n: int) -> FloatArray:
    """Fall per metre of a smoothed polyline, as means over stretches of equal length.

    It is the polyline's own, averaged with Gaussian weights of standard deviation ``sqrt(2 ln 2)
    smoothing_m``; beyond its ends the track goes on as its mirror image, so that what smoothing takes from
    one place another gets. Elevation, the integral of it, is averaged alike.

    Parameters
    ----------
    along_m, z_m : (n_points,) array, m
        Distance along which it is smoothed, from 0, and elevation. Of arc length it is the slope's sine.
    smoothing_m : float, m
        Undulations of wavelength ``2 pi smoothing_m`` lose half their amplitude; 0 leaves all as it is.
    n : int
        Number of stretches.

    Returns
    -------
    (n,) array
        Downhill positive; their sum times the stretches' length is the whole fall.

    Raises
    ------
    InputError
        If the smoothing length is longer than the track.
    """
    # Here, because laws and their command lines import this module and scipy takes half a second.
    from scipy.ndimage import gaussian_filter1d

    if smoothing_m > along_m[-1]:
        raise InputError(
            f"smoothed over {smoothing_m:g} m, and the track has {along_m[-1]:.4g} m; choose a shorter one"
        )
    length = along_m[-1] / n
    slopes: FloatArray = -np.diff(np.interp(np.linspace(0.0, along_m[-1], n + 1), along_m, z_m)) / length
    if smoothing_m == 0.0:
        return slopes
    smoothed: FloatArray = gaussian_filter1d(slopes, smoothing_m * SD_PER_SMOOTHING / length, mode="reflect")
    return smoothed
