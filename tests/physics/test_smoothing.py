"""Smoothing along the arc length: no overshoot, nothing lost, and Ryggfonn as it was with another method."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import make_smoothing_spline

from skred.campaign import Track, find_campaign, read_campaign
from skred.physics.geometry import contributions_of, path_of, sensor_table
from skred.physics.kernel.fronts import simulate
from skred.physics.terrain import SD_PER_SMOOTHING, Terrain, build_terrain
from skred.physics.terrain_hints import smoothing_cost, terrain_hints


def fallen(terrain: Terrain) -> np.ndarray:
    """Fall from the track's first point to each edge [m]."""
    return np.concatenate([[0.0], np.cumsum(terrain.sin_slope * np.diff(terrain.edge_s_m))])


@st.composite
def tracks(draw: st.DrawFn) -> Track:
    """Polylines with any slopes up to 80 degrees, in steps from 0.5 to 60 m."""
    steps = draw(st.lists(st.tuples(st.floats(0.5, 60.0), st.floats(-80.0, 80.0)), min_size=3, max_size=40))
    x = np.concatenate([[0.0], np.cumsum([step for step, _ in steps])])
    z = np.concatenate([[0.0], -np.cumsum([step * np.tan(np.radians(angle)) for step, angle in steps])])
    return Track(x, 500.0 + z)


@given(tracks(), st.floats(0.01, 0.2))
def test_nothing_overshoots_and_nothing_is_lost(track: Track, share: float) -> None:
    smoothing_m = share * track.length_m
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    fall = fallen(terrain)
    drop = track.z_m[0] - track.z_m[-1]
    assert_allclose(fall[-1], drop, atol=1e-9 * track.length_m)
    assert_allclose(terrain.length_m, track.length_m)
    sines = -np.diff(track.z_m) / np.diff(track.s_m)
    # The weights reach four standard deviations; a cell is so much wider, and beyond the ends is a mirror.
    reach = 4.2 * SD_PER_SMOOTHING * smoothing_m + np.diff(terrain.edge_s_m).max()
    for k, sine in enumerate(terrain.sin_slope):
        low, high = terrain.edge_s_m[k] - reach, terrain.edge_s_m[k + 1] + reach
        near = sines[(track.s_m[1:] >= low) & (track.s_m[:-1] <= high)]
        assert near.min() - 1e-9 <= sine <= near.max() + 1e-9
    altitude = track.z_m[0] - fall
    assert track.z_m.min() - 1e-6 <= altitude.min() and altitude.max() <= track.z_m.max() + 1e-6


@given(tracks(), st.floats(0.01, 0.2))
def test_ground_that_only_falls_still_does(track: Track, share: float) -> None:
    down = Track(track.x_m, np.minimum.accumulate(track.z_m))
    terrain = build_terrain(down.x_m, down.z_m, smoothing_m=share * down.length_m)
    assert terrain.sin_slope.min() >= -1e-12


@given(tracks(), st.floats(0.01, 0.2))
def test_curvature_turns_the_track_by_its_slopes(track: Track, share: float) -> None:
    """The sum of all turns is the difference of the slopes at the ends."""
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=share * track.length_m)
    turned = -(terrain.curvature @ np.diff(terrain.edge_s_m))
    slopes = terrain.slope_rad
    steps = 2.0 * np.abs(np.diff(slopes)).max(initial=0.0) + 1e-9
    assert abs(turned - (slopes[-1] - slopes[0])) <= steps


@pytest.mark.parametrize("wave_number", [0.02, 0.05, 0.1, 0.2])
def test_a_wave_of_63_m_loses_half(wave_number: float) -> None:
    s = np.arange(0.0, 4000.0, 2.0)
    z = 1000.0 - 0.3 * s + 0.5 * np.sin(wave_number * s)
    x = np.concatenate([[0.0], np.cumsum(np.sqrt(np.diff(s) ** 2 - np.diff(z) ** 2))])
    terrain = build_terrain(x, z, smoothing_m=10.0)
    middle = 0.5 * (terrain.edge_s_m[1:] + terrain.edge_s_m[:-1])
    wave = np.cos(wave_number * middle)
    inner = slice(100, -100)
    left = (terrain.sin_slope[inner] - 0.3) @ wave[inner] / (wave[inner] @ wave[inner])
    cell = wave_number * np.diff(terrain.edge_s_m)[0] / 2.0  # a cell's slope is a mean
    given_sine = -0.5 * wave_number * np.sin(cell) / cell
    assert left / given_sine == pytest.approx(0.5 ** ((10.0 * wave_number) ** 2), abs=0.01)


def ramp(angle_deg: float = 80.0, length_m: float = 40.0, level_m: float = 1500.0) -> Track:
    """A steep short ramp, then level ground, with a point every 2 m of arc length."""
    slope = np.radians(angle_deg)
    on_ramp = np.arange(0.0, length_m + 1.0, 2.0)
    on_level = np.arange(4.0, level_m, 4.0)
    x = np.concatenate([on_ramp * np.cos(slope), length_m * np.cos(slope) + on_level])
    z = np.concatenate([(length_m - on_ramp) * np.sin(slope), np.zeros(len(on_level))])
    return Track(x, z)


@pytest.mark.parametrize("smoothing_m", [1.0, 5.0, 10.0])
def test_a_steep_short_ramp_keeps_its_fall(smoothing_m: float) -> None:
    """Smoothed by a spline over horizontal distance it lost a third, and went up by 38 degrees below."""
    track = ramp()
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    fall = np.interp([55.0, 200.0], terrain.edge_s_m, fallen(terrain))
    assert_allclose(fall, track.z_m[0], rtol=0.02)
    assert fall[1] == pytest.approx(track.z_m[0], abs=1e-3)
    assert np.degrees(terrain.slope_rad).min() > -1e-6 and np.degrees(terrain.slope_rad).max() < 80.0 + 1e-6
    assert terrain_hints(track, terrain, np.array([0.0, 55.0])) == []


def test_what_smoothing_takes_from_a_ramp_is_told() -> None:
    track = ramp()
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=30.0)
    hints = [one.message for one in terrain_hints(track, terrain, np.array([0.0, 45.0]))]
    assert any("falls 39.4 m, but smoothed over 30 m 2" in hint for hint in hints)
    cost = smoothing_cost(track, terrain, np.array([0.0, 45.0]))
    assert cost.steepest_deg == pytest.approx(80.0) and cost.steepest_smoothed_deg < 70.0
    lost = 39.39 - np.interp(45.0, terrain.edge_s_m, fallen(terrain))
    assert cost.change_of_fall_m == pytest.approx(lost, abs=0.01) and lost > 5.0


def by_spline(track: Track) -> Terrain:
    """The terrain as it was made before: one smoothing spline over horizontal distance."""
    edge_s = build_terrain(track.x_m, track.z_m).edge_s_m
    edge_x = np.interp(edge_s, track.s_m, track.x_m)
    spline = make_smoothing_spline(track.x_m, track.z_m, lam=10.0**4 / np.mean(np.diff(track.x_m)))
    length = np.diff(edge_s)
    sines = -np.diff(spline(edge_x)) / length
    turns = np.diff(np.arctan(spline.derivative()(edge_x))) / length
    return Terrain(edge_s, sines, np.sqrt(1.0 - sines**2), turns, 10.0)


@pytest.mark.parametrize(
    ("campaign", "speed_m_s", "runout_m"), [("ryggfonn", 0.02, 0.05), ("ryggfonn-with-dam", 0.6, 1.5)]
)
def test_fronts_at_ryggfonn_are_those_of_the_spline(campaign: str, speed_m_s: float, runout_m: float) -> None:
    """By the posterior means of pcm; the speeds of the posterior are uncertain by 2.6 to 3.6 m/s."""
    from models.pcm import LAW

    recorded = read_campaign(find_campaign(campaign))
    places = [None if one.is_runout else (one.s_from_m, one.s_to_m) for one in recorded.sensors]
    strengths = np.array([[float(one) for one in LAW.strengths(0.2858, 0.002253)]])
    read = [
        simulate(
            strengths,
            np.zeros(1),
            path_of(terrain),
            contributions_of(LAW.mechanisms, terrain),
            sensor_table(places),
        )
        for terrain in (build_terrain(recorded.track.x_m, recorded.track.z_m), by_spline(recorded.track))
    ]
    difference = np.abs(np.subtract(*(np.asarray(one)[0] for one in read)))
    is_runout = np.array([one.is_runout for one in recorded.sensors])
    assert difference[~is_runout].max() < speed_m_s and difference[is_runout].max() < runout_m
