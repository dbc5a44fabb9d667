"""Smooth tracks of seven families, drawn at random, and the polyline a campaign shows of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from skred.arrays import FloatArray

GRID_M = 5.0
"""Spacing of the tables along the track [m]."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A track as the front feels it.

    Attributes
    ----------
    table : (n_cells, 3, 4) array
        Cubics in the distance from each grid point: slope angle phi [rad, downhill positive], curvature of
        the track in plan [1/m], and a reference speed [m/s], each by ascending powers.
    length_m : float, m
        Arc length; beyond it the slope stays as it is.
    family : str
        Which kind of track.
    track_x_m, track_z_m : (n_points,) array, m
        The campaign's polyline, rounded to centimetres.
    point_s_m, polyline_s_m : (n_points,) array, m
        True arc length of its points, and the arc length that a reader of the polyline computes.
    """

    table: FloatArray
    length_m: float
    family: str
    track_x_m: FloatArray
    track_z_m: FloatArray
    point_s_m: FloatArray
    polyline_s_m: FloatArray

    def to_campaign(self, s_m: FloatArray) -> FloatArray:
        """Arc length along the campaign's polyline [m] of places on the true track [m]."""
        return np.interp(s_m, self.point_s_m, self.polyline_s_m)

    def from_campaign(self, s_m: FloatArray) -> FloatArray:
        """Inverse of `to_campaign`."""
        return np.interp(s_m, self.polyline_s_m, self.point_s_m)

    def slope_rad(self, s_m: FloatArray) -> FloatArray:
        """Slope angle [rad] at places on the true track [m]."""
        return _evaluate(self.table[:, 0], s_m)


def _evaluate(cubics: FloatArray, s_m: FloatArray) -> FloatArray:
    cell = np.clip((np.asarray(s_m) / GRID_M).astype(int), 0, len(cubics) - 1)
    d = s_m - cell * GRID_M
    c = cubics[cell]
    result: FloatArray = c[..., 0] + d * (c[..., 1] + d * (c[..., 2] + d * c[..., 3]))
    return result


def cubics_of(values: FloatArray) -> FloatArray:
    """Natural cubic spline through values on the grid: (n_cells, 4), ascending powers of the distance."""
    spline = CubicSpline(GRID_M * np.arange(len(values)), values, bc_type="natural")
    return np.ascontiguousarray(spline.c[::-1].T)


def make_ground(
    slope_rad: FloatArray, bend_1_m: FloatArray, family: str, spacing_m: float, foot_m: float
) -> Ground:
    """Ground from slope angle [rad] and curvature in plan [1/m] on the grid.

    The polyline has a point every `spacing_m` [m]; its lowest is near the elevation `foot_m` [m].
    """
    length = GRID_M * (len(slope_rad) - 1)
    cubics = cubics_of(slope_rad)
    fine = np.linspace(0.0, length, 10 * (len(slope_rad) - 1) + 1)
    phi = _evaluate(cubics, fine)
    step = fine[1]
    # Simpson's rule over pairs of half-metre steps, sums at every second point
    x, z = (
        np.concatenate(([0.0], np.cumsum((f[:-2:2] + 4.0 * f[1:-1:2] + f[2::2]) * step / 3.0)))
        for f in (np.cos(phi), -np.sin(phi))
    )
    z += foot_m - z.min()
    points = np.linspace(0.0, length, max(int(round(length / spacing_m)), 8) + 1)
    track_x = np.round(CubicSpline(fine[::2], x)(points), 2)
    track_z = np.round(CubicSpline(fine[::2], z)(points), 2)
    steps = np.hypot(np.diff(track_x), np.diff(track_z))
    zeros = np.zeros((len(cubics), 4))
    table = np.ascontiguousarray(np.stack([cubics, cubics_of(bend_1_m), zeros], axis=1))
    polyline = np.concatenate(([0.0], np.cumsum(steps)))
    return Ground(table, length, family, track_x, track_z, points, polyline)


def _knots(rng: np.random.Generator, length: float, angles: list[float], places: list[float]) -> FloatArray:
    """Slope angles [degree] through jittered knots (places as shares of the length)."""
    at = np.array(places) * length
    at[1:-1] += rng.normal(0.0, 0.02 * length, len(at) - 2)
    at[1:-1] = np.clip(np.sort(at[1:-1]), 0.02 * length, 0.98 * length)
    at += 1e-3 * np.arange(len(at))
    jitter = rng.normal(0.0, 1.2, len(angles))
    jitter[-2:] *= 0.3
    grid = GRID_M * np.arange(int(length / GRID_M) + 1)
    return np.asarray(PchipInterpolator(at, np.array(angles) + jitter)(np.minimum(grid, at[-1])))


def _ryggfonn_like(rng: np.random.Generator) -> FloatArray:
    angles = [46.0, 30.0, 27.0, 35.0, 31.0, 24.0, 8.0, 2.5, 1.5]
    return _knots(rng, rng.uniform(2100, 2700), angles, [0.0, 0.08, 0.2, 0.36, 0.5, 0.56, 0.66, 0.75, 1.0])


def _parabolic(rng: np.random.Generator) -> FloatArray:
    """Parabola z(x) that ends in a gentle, even slope."""
    steepest, end = np.tan(np.radians(rng.uniform(36, 47))), np.tan(np.radians(rng.uniform(0.5, 4.0)))
    reach = rng.uniform(900, 1900)
    x = np.linspace(0.0, 1.6 * reach, 4000)
    excess = steepest * (1.0 - x / reach) - end
    tangent = end + 0.5 * (excess + np.sqrt(excess**2 + 0.03**2))
    s = np.concatenate(([0.0], np.cumsum(np.hypot(1.0, tangent[1:]) * np.diff(x))))
    grid = GRID_M * np.arange(int(s[-1] / GRID_M))
    return np.asarray(np.degrees(np.arctan(np.interp(grid, s, tangent))))


def _channel(rng: np.random.Generator) -> FloatArray:
    length = rng.uniform(1600, 2600)
    s = GRID_M * np.arange(int(length / GRID_M) + 1)
    top, end = rng.uniform(38, 46), rng.uniform(1.0, 4.0)
    fall = 1.0 / (1.0 + np.exp((s - 0.45 * length) / (0.11 * length)))
    ripple = rng.uniform(1.5, 3.0) * np.sin(2 * np.pi * s / rng.uniform(250, 450) + rng.uniform(0, 6))
    return np.asarray(end + (top - end) * fall**0.7 + ripple * np.exp(-(((s / length - 0.4) / 0.25) ** 2)))


def _stepped(rng: np.random.Generator) -> FloatArray:
    angles = [42.0, 38.0, 20.0, 17.0, 37.0, 33.0, 15.0, 9.0, 5.0, 2.0]
    return _knots(
        rng, rng.uniform(1500, 2300), angles, [0.0, 0.14, 0.2, 0.27, 0.33, 0.45, 0.52, 0.6, 0.7, 1.0]
    )


def _short_and_steep(rng: np.random.Generator) -> FloatArray:
    angles = [48.0, 42.0, 36.0, 25.0, 12.0, 5.0, 3.0]
    return _knots(rng, rng.uniform(750, 1100), angles, [0.0, 0.2, 0.36, 0.46, 0.56, 0.7, 1.0])


def _long_and_flat(rng: np.random.Generator) -> FloatArray:
    angles = [37.0, 33.0, 24.0, 20.0, 15.0, 11.0, 6.0, 3.0]
    return _knots(rng, rng.uniform(2500, 3400), angles, [0.0, 0.12, 0.22, 0.36, 0.5, 0.62, 0.75, 1.0])


def _opposite_slope(rng: np.random.Generator) -> FloatArray:
    angles = [42.0, 38.0, 30.0, 20.0, 5.0, -1.0, -6.0, -9.0]
    return _knots(rng, rng.uniform(1200, 2000), angles, [0.0, 0.2, 0.38, 0.48, 0.58, 0.68, 0.82, 1.0])


FAMILIES: dict[str, Callable[[np.random.Generator], FloatArray]] = {
    "ryggfonn_like": _ryggfonn_like,
    "parabolic": _parabolic,
    "channel": _channel,
    "stepped": _stepped,
    "short_and_steep": _short_and_steep,
    "long_and_flat": _long_and_flat,
    "opposite_slope": _opposite_slope,
}


def _bends(rng: np.random.Generator, length: float, family: str) -> FloatArray:
    """Curvature in plan [1/m] on the grid: two to four bends, tight ones in a channel."""
    s = GRID_M * np.arange(int(length / GRID_M) + 1)
    radius = (120.0, 300.0) if family == "channel" else (300.0, 800.0)
    bend = np.zeros(len(s))
    for _ in range(rng.integers(2, 5)):
        centre, width = rng.uniform(0.25, 0.75) * length, rng.uniform(40, 90)
        bend += rng.choice([-1.0, 1.0]) / rng.uniform(*radius) * np.exp(-(((s - centre) / width) ** 2))
    return bend


def draw_ground(rng: np.random.Generator, family: str | None = None) -> Ground:
    """Draw a track.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where chance comes from.
    family : str, optional
        One of `FAMILIES`; drawn if not given.
    """
    family = str(rng.choice(sorted(FAMILIES))) if family is None else family
    angles = FAMILIES[family](rng)
    smooth = gaussian_filter1d(angles, rng.uniform(25.0, 45.0) / GRID_M, mode="nearest")
    length = GRID_M * (len(smooth) - 1)
    bends = _bends(rng, length, family)[: len(smooth)]
    return make_ground(np.radians(smooth), bends, family, rng.uniform(10.0, 25.0), rng.uniform(20.0, 900.0))
