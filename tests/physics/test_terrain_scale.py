"""Smoothing and cells follow the length of the track: a chute in a laboratory, and a long path."""

from __future__ import annotations

import numpy as np
import pytest

from skred.campaign import find_campaign, read_campaign
from skred.physics.terrain import CELL_M, SMOOTHING_M, build_terrain


def chute(scale: float) -> tuple[np.ndarray, np.ndarray]:
    """A parabola and a level run-out, 600 m long at scale 1."""
    x = np.linspace(0.0, 540.0, 109)
    return scale * x, scale * 1e-3 * np.maximum(450.0 - x, 0.0) ** 2


@pytest.mark.parametrize("scale", [0.003, 0.1, 1.0])
def test_a_chute_is_a_path_seen_from_afar(scale: float) -> None:
    small, usual = build_terrain(*chute(scale)), build_terrain(*chute(1.0))
    assert small.n_cells >= 95
    if small.length_m < 600.0:
        assert small.smoothing_m == pytest.approx(SMOOTHING_M * small.length_m / 600.0)
    share = np.linspace(0.02, 0.98, 50)
    slopes = [
        np.interp(share, (t.edge_s_m[1:] + t.edge_s_m[:-1]) / (2.0 * t.length_m), t.slope_rad)
        for t in (small, usual)
    ]
    np.testing.assert_allclose(*slopes, atol=0.02)
    fall = float(small.sin_slope @ np.diff(small.edge_s_m))
    assert fall == pytest.approx(float(np.ptp(chute(scale)[1])), rel=0.01)


def test_usual_paths_are_as_they_were() -> None:
    track = read_campaign(find_campaign("ryggfonn")).track
    default = build_terrain(track.x_m, track.z_m)
    stated = build_terrain(track.x_m, track.z_m, smoothing_m=10.0, cell_m=6.0)
    assert default.smoothing_m == SMOOTHING_M and np.diff(default.edge_s_m).max() <= CELL_M
    for name in ("edge_s_m", "sin_slope", "curvature"):
        np.testing.assert_array_equal(getattr(default, name), getattr(stated, name))
