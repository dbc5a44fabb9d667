"""Terrain: known tracks, the energy of the fall, and inputs that must be refused."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skred.campaign import find_campaign, read_campaign
from skred.errors import InputError
from skred.physics.geometry import path_of, sensor_table
from skred.physics.kernel.inputs import FRONT_VELOCITY, RUNOUT
from skred.physics.terrain import Terrain, build_terrain


def test_an_inclined_plane_is_an_inclined_plane() -> None:
    x = np.linspace(0.0, 900.0, 46)
    terrain = build_terrain(x, 1000.0 - 0.75 * x)
    assert_allclose(terrain.length_m, 1125.0)
    assert np.diff(terrain.edge_s_m).max() <= 6.0
    assert_allclose(terrain.sin_slope, 0.6, rtol=1e-7)
    assert_allclose(terrain.slope_rad, np.arcsin(0.6), rtol=1e-7)
    assert_allclose(terrain.curvature, 0.0, atol=1e-8)


def test_a_parabola_has_its_curvature() -> None:
    x = np.linspace(0.0, 1000.0, 201)
    z = 4e-4 * (x - 1000.0) ** 2
    terrain = build_terrain(x, z, smoothing_m=10.0)
    s = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(z))))
    middle = np.interp((terrain.edge_s_m[1:] + terrain.edge_s_m[:-1]) / 2, s, x)
    gradient = 8e-4 * (middle - 1000.0)
    inner = slice(10, -10)
    assert_allclose(terrain.curvature[inner], (8e-4 / (1 + gradient**2) ** 1.5)[inner], rtol=2e-3)
    assert_allclose(np.tan(terrain.slope_rad)[inner], -gradient[inner], rtol=2e-3, atol=1e-4)


@pytest.mark.parametrize("smoothing_m", [0.0, 10.0, 30.0])
def test_the_fall_along_ryggfonn_is_that_of_the_track(smoothing_m: float) -> None:
    track = read_campaign(find_campaign("ryggfonn")).track
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    fall = (terrain.sin_slope * np.diff(terrain.edge_s_m)).sum()
    assert_allclose(fall, track.z_m[0] - track.z_m[-1], rtol=1e-12)
    assert_allclose(terrain.length_m, np.hypot(np.diff(track.x_m), np.diff(track.z_m)).sum())


def test_more_smoothing_leaves_less_curvature() -> None:
    track = read_campaign(find_campaign("ryggfonn")).track
    rough, smooth = (build_terrain(track.x_m, track.z_m, smoothing_m=m).curvature for m in (10.0, 40.0))
    assert np.abs(smooth).max() < np.abs(rough).max()


def test_three_points_make_a_terrain() -> None:
    terrain = build_terrain(np.array([0.0, 100.0, 300.0]), np.array([100.0, 40.0, 0.0]))
    assert terrain.n_cells > 50


def test_what_is_refused() -> None:
    x = np.linspace(0.0, 100.0, 11)
    with pytest.raises(ValueError, match="cell_m must be positive"):
        build_terrain(x, -x, cell_m=0.0)
    with pytest.raises(ValueError, match="choose longer cells"):
        build_terrain(x, -x, cell_m=1e-4)
    with pytest.raises(ValueError, match="sin_slope: expected 1 finite values"):
        Terrain(np.array([0.0, 1.0]), np.array([np.nan]), np.array([1.0]), np.array([0.0]))
    with pytest.raises(ValueError, match="increasing"):
        Terrain(np.array([0.0, 0.0]), np.array([0.5]), np.array([0.8]), np.array([0.0]))
    with pytest.raises(InputError, match="choose a shorter one"):
        build_terrain(x, -x, smoothing_m=1e9)
    terrain = build_terrain(x, -x)
    with pytest.raises(ValueError, match="needs a place on the track"):
        path_of(terrain, [(1e4, 1.0, 0.0)])
    with pytest.raises(ValueError, match="read-only"):
        terrain.curvature[0] = 1.0


def test_sensors_and_barriers_as_the_kernel_reads_them() -> None:
    table = sensor_table([(3.0, 3.0), None, (4.0, 9.0)])
    assert_allclose(table, [[FRONT_VELOCITY, 3, 3], [RUNOUT, 0, 0], [FRONT_VELOCITY, 4, 9]])
    terrain = build_terrain(np.linspace(0.0, 100.0, 11), -np.linspace(0.0, 100.0, 11))
    path = path_of(terrain, [(50.0, 2.0, 0.0), (20.0, 1.0, 5.0)])
    assert_allclose(path.barriers[:, 0], [20.0, 50.0])
    # A barrier's cell is never passed unlooked at.
    cell = np.searchsorted(terrain.edge_s_m, 20.0, side="right") - 1
    assert np.all(path.limits[[cell, cell + 1]] < 0)
