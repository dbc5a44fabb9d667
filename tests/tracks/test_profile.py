"""Profiles on terrain whose elevations, lengths and slopes are known in closed form."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from map_cases import bowl, on_map, plane, write_dem, write_line

from skred.errors import InputError
from skred.physics.terrain import build_terrain
from skred.prediction.track import read_track
from skred.prediction.track_origin import track_origin
from skred.tracks.build import Wanted, make_track
from skred.tracks.files import track_table
from skred.tracks.profile import rise_notice, shape, smoothed, smoothed_twice_as_m
from skred.tracks.statement import track_statement

DOWN = [(100.0, 100.0), (500.0, 400.0), (900.0, 400.0)]
"""Two straight pieces of 500 and 400 m."""


@pytest.mark.parametrize("suffix", ["tif", "asc"])
@pytest.mark.parametrize("step", [None, 7.0, 250.0])
def test_a_plane_is_sampled_exactly(tmp_path: Path, suffix: str, step: float | None) -> None:
    dem = write_dem(tmp_path / f"dem.{suffix}", plane)
    line = write_line(tmp_path / "line.gpkg", DOWN)
    made = make_track(Wanted(dem, line, step_m=step, smoothing_m=0.0))
    profile = {name: np.array(values) for name, values in made["profile"].items()}
    x_m = profile["x_m"]
    assert x_m[0] == 0.0 and x_m[-1] == pytest.approx(900.0, abs=1e-3)
    assert np.ptp(np.diff(x_m)) < 1e-3 and np.diff(x_m).max() <= (step or 10.0) + 1e-3
    # 0.5 * 0.8 + 0.25 * 0.6 along the first piece, 0.5 along the second
    expected = plane(100.0, 100.0) - 0.55 * np.minimum(x_m, 500.0) - 0.5 * np.maximum(x_m - 500.0, 0.0)
    np.testing.assert_allclose(profile["z_m"], expected, atol=2e-3)
    np.testing.assert_allclose(plane(profile["east_m"] - 4e5, profile["north_m"] - 52e5), expected, atol=2e-3)
    written = made["smoothing"]["written"]
    assert written["fall_m"] == pytest.approx(475.0, abs=2e-3)
    if step is None:
        arc = 500 * math.hypot(1, 0.55) + 400 * math.hypot(1, 0.5)
        assert written["length_m"] == pytest.approx(arc, abs=0.01)
    assert written["steepest_deg"] == pytest.approx(math.degrees(math.atan(0.55)), abs=0.05)
    assert written["steepest_uphill_deg"] == 0.0


def test_between_cells_elevations_are_bilinear(tmp_path: Path) -> None:
    """Between the centres of cells x y is exact: a bilinear function is its own interpolant."""

    def saddle(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 1500.0 - 1e-3 * x * y

    dem, line = (
        write_dem(tmp_path / "d.tif", saddle),
        write_line(tmp_path / "l.gpkg", [(103, 107), (901, 888)]),
    )
    profile = make_track(Wanted(dem, line, smoothing_m=0.0))["profile"]
    x, y = np.array(profile["east_m"]) - 4e5, np.array(profile["north_m"]) - 52e5
    np.testing.assert_allclose(profile["z_sampled_m"], saddle(x, y), atol=2e-4)


def test_tiles_do_not_show(tmp_path: Path) -> None:
    """A raster of several tiles, crossed on a diagonal, read in pieces."""
    dem = write_dem(tmp_path / "dem.tif", plane, cell=1.0, size=900)
    line = write_line(tmp_path / "line.gpkg", [(5.0, 5.0), (890.0, 890.0), (895.0, 300.0)])
    profile = make_track(Wanted(dem, line, smoothing_m=0.0))["profile"]
    x, y = np.array(profile["east_m"]) - 4e5, np.array(profile["north_m"]) - 52e5
    np.testing.assert_allclose(profile["z_m"], plane(x, y), atol=1e-3)


def test_a_line_that_goes_uphill_is_turned(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "dem.tif", plane)
    down = make_track(Wanted(dem, write_line(tmp_path / "down.gpkg", DOWN)))
    up = make_track(Wanted(dem, write_line(tmp_path / "up.gpkg", DOWN[::-1])))
    np.testing.assert_allclose(up["profile"]["z_m"], down["profile"]["z_m"], atol=1e-6)
    assert up["line"]["turned"] and not down["line"]["turned"]
    (notice,) = up["notices"]
    assert notice == "the line goes uphill, from 1450 to 1925 m: turned" and down["notices"] == []
    assert f"Notice: {notice}." in track_statement(up)


def test_a_level_line_is_refused(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "dem.tif", plane)
    line = write_line(tmp_path / "line.gpkg", [(200, 100), (100, 300)])
    with pytest.raises(InputError, match="begins and ends at the same elevation, 1875.0 m"):
        make_track(Wanted(dem, line, step_m=1000.0))


def test_a_rise_is_told_with_its_place(tmp_path: Path) -> None:
    s = np.linspace(0.0, 100.0, 11)
    z = np.array([50, 40, 30, 20, 25, 31, 28, 10, 9.8, 9.9, 5.0])
    assert rise_notice(s, z) == [
        "the track rises by 11.0 m from s = 30 to 50 m: a dam, a counter-slope, or a line that leaves the "
        "gully"
    ]
    assert rise_notice(s, np.sort(z)[::-1]) == []


HOLES = [(row, column) for row in (55, 56) for column in (59, 60)]


@pytest.mark.parametrize("no_data", [-9999.0, None], ids=["declared", "undeclared"])
def test_no_data_is_named_by_coordinate(tmp_path: Path, no_data: float | None) -> None:
    """Cells 59 and 60 from the west, 43 and 44 from the south: without data from x = 585 to 615 m."""
    dem = write_dem(tmp_path / "dem.tif", plane, holes=HOLES, no_data=no_data)
    line = write_line(tmp_path / "line.gpkg", [(100.0, 440.0), (900.0, 440.0)])
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, line, step_m=5.0))
    told = str(error.value)
    assert "no elevation at 5 of 161 points" in told
    assert "no data from (400590.0, 5200440.0) to (400610.0, 5200440.0), 490 to 510 m along the line" in told
    assert "off the raster" not in told and str(dem) in told


def test_off_the_raster_is_named_by_coordinate(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "dem.tif", plane)
    line = write_line(tmp_path / "line.gpkg", [(100.0, 440.0), (1100.0, 440.0)])
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, line, step_m=100.0))
    told = str(error.value)
    assert "off the raster from (401000.0, 5200440.0) to (401100.0, 5200440.0), 900 to 1000 m" in told
    assert "the raster covers x 400005.0 to 400995.0, y 5200005.0 to 5200995.0" in told


def test_a_hole_beside_the_line_does_not_matter(tmp_path: Path) -> None:
    """Along the centres of a row of cells the next row has no weight."""
    holes = [(row, 60) for row in (55, 57)]
    dem = write_dem(tmp_path / "dem.tif", plane, holes=holes)
    line = write_line(tmp_path / "line.gpkg", [(100.0, 435.0), (900.0, 435.0)])
    assert len(make_track(Wanted(dem, line))["profile"]["z_m"]) == 81


def test_too_many_points_are_refused(tmp_path: Path) -> None:
    dem, line = write_dem(tmp_path / "d.tif", plane), write_line(tmp_path / "l.gpkg", DOWN)
    with pytest.raises(InputError, match="choose a longer --step"):
        make_track(Wanted(dem, line, step_m=1e-3))


@pytest.mark.parametrize("wave_number", [0.02, 0.1, 0.2])
def test_smoothing_takes_from_waves_what_its_formula_says(wave_number: float) -> None:
    """Of a wave along the track 2^-(q l)^2 is left, by least squares over its middle part."""
    x = np.arange(0.0, 4000.0, 2.0)
    z = 1000.0 - 0.01 * x + 0.1 * np.sin(wave_number * x)
    left = smoothed(x, z, 10.0) - (1000.0 - 0.01 * x)
    middle = slice(500, 1500)
    wave = np.sin(wave_number * x[middle])
    amplitude = float(wave @ left[middle] / (wave @ wave))
    assert amplitude == pytest.approx(0.1 * 0.5 ** ((10.0 * wave_number) ** 2), rel=0.01, abs=1e-3)


def test_two_smoothings_are_as_one() -> None:
    x = np.linspace(0.0, 900.0, 301)
    z = 300.0 - 0.02 * x + np.where(x > 450.0, -3.0, 0.0)
    twice, once = smoothed(x, smoothed(x, z, 6.0), 8.0), smoothed(x, z, smoothed_twice_as_m(6.0, 8.0))
    assert smoothed_twice_as_m(6.0, 8.0) == pytest.approx(10.0) and smoothed_twice_as_m(0.0, 10.0) == 10.0
    np.testing.assert_allclose(twice, once, atol=0.03)
    assert np.abs(twice - z).max() > 1.0


def test_the_cost_of_smoothing_is_that_of_the_written_table(tmp_path: Path) -> None:
    def step(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return plane(x, y) - np.where(x > 500.0, 30.0, 0.0)

    dem = write_dem(tmp_path / "dem.tif", step)
    made = make_track(
        Wanted(dem, write_line(tmp_path / "l.gpkg", [(105, 500), (905, 500)]), smoothing_m=20.0)
    )
    before, after = made["smoothing"]["sampled"], made["smoothing"]["written"]
    assert before["fall_m"] == pytest.approx(430.0) and before["steepest_deg"] == pytest.approx(
        math.degrees(math.atan(3.5)), abs=0.01
    )
    profile = made["profile"]
    assert after == pytest.approx(vars(shape(np.array(profile["x_m"]), np.array(profile["z_m"]))))
    assert after["steepest_deg"] < before["steepest_deg"] - 10 and after["length_m"] < before["length_m"]
    text = " ".join(track_statement(made))
    assert f"the length by {after['length_m'] - before['length_m']:+.1f} m" in text


def test_what_the_commands_see_is_their_own_terrain(tmp_path: Path) -> None:
    """The fall that is told is that of `build_terrain` on the written table, within a cell at each end."""
    dem = write_dem(tmp_path / "dem.tif", bowl)
    made = make_track(Wanted(dem, write_line(tmp_path / "l.gpkg", [(60, 60), (480, 480)])))
    terrain = build_terrain(np.array(made["profile"]["x_m"]), np.array(made["profile"]["z_m"]))
    fall = float(terrain.sin_slope @ np.diff(terrain.edge_s_m))
    told = made["smoothing"]["as_read"]
    assert told["fall_m"] == pytest.approx(fall, abs=0.01)
    assert told["steepest_deg"] == pytest.approx(math.degrees(terrain.slope_rad.max()), abs=0.3)


def test_the_document_says_where_it_comes_from(tmp_path: Path) -> None:
    dem, line = write_dem(tmp_path / "dem.tif", plane), write_line(tmp_path / "line.gpkg", DOWN)
    made = json.loads(json.dumps(make_track(Wanted(dem, line))))
    assert made["terrain"]["file"] == "dem.tif" and made["terrain"]["bytes"] == dem.stat().st_size
    assert len(made["line"]["sha256"]) == 64 and made["line"]["vertices"] == 3
    assert made["terrain"]["reference_system"] == "EPSG:32632 (WGS 84 / UTM zone 32N)"
    assert str(tmp_path) not in json.dumps(made)
    assert on_map(DOWN)[0] == (made["profile"]["east_m"][0], made["profile"]["north_m"][0])


@pytest.mark.parametrize("smoothing_m", [0.0, 5.0, 200.0])
@pytest.mark.parametrize("no_data", [0.0, 500.0])
def test_a_hole_that_the_file_does_not_declare_is_refused(
    tmp_path: Path, smoothing_m: float, no_data: float
) -> None:
    """However much it is smoothed: that makes a dale of it."""

    def holed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 500.0) < 60.0) & (np.abs(y - 500.0) < 60.0), no_data, plane(x, y))

    dem = write_dem(tmp_path / "dem.tif", holed, no_data=None)
    across = write_line(tmp_path / "line.gpkg", [(100.0, 505.0), (900.0, 505.0)])
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, across, smoothing_m=smoothing_m))
    told = str(error.value)
    assert "dem.tif: the ground goes from" in told and "expected at most 80. Are there cells without" in told
    assert f"{no_data:.1f} m between (400" in told and ", 5200505.0)" in told
    assert "Declare them (rio edit-info dem.tif --nodata 0)" in told
    beside = write_line(tmp_path / "beside.gpkg", [(100.0, 205.0), (900.0, 205.0)])
    assert make_track(Wanted(dem, beside, smoothing_m=smoothing_m))["notices"] == []


def test_a_rock_step_is_ground(tmp_path: Path) -> None:
    """On fine cells it is steeper than 80 degrees before smoothing; other commands read what is written."""

    def step(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return plane(x, y) - np.where(x > 50.0, 12.0, 0.0)

    dem = write_dem(tmp_path / "dem.tif", step, cell=1.0)
    line = write_line(tmp_path / "line.gpkg", [(10.0, 50.5), (90.0, 50.5)])
    document = make_track(Wanted(dem, line))
    assert document["smoothing"]["sampled"]["steepest_deg"] > 80.0
    (tmp_path / "track.csv").write_text(track_table(document))
    assert len(read_track(tmp_path / "track.csv").x_m) == len(document["profile"]["x_m"])
    with pytest.raises(InputError, match="At a cliff, lay the line beside it, or smooth more"):
        make_track(Wanted(dem, line, smoothing_m=0.0))


@pytest.mark.parametrize(("end", "told"), [((8.0, 8.0), "refuses it"), ((60.0, 60.0), "smooths it more")])
def test_a_short_track_is_told(tmp_path: Path, end: tuple[float, float], told: str) -> None:
    line = write_line(tmp_path / "line.gpkg", [(3.0, 3.0), end])
    made = make_track(Wanted(write_dem(tmp_path / "dem.tif", plane, cell=1.0), line))
    (notice,) = made["notices"]
    assert notice.startswith("the track is only ") and told in notice and "in metres" in notice


def test_both_lengths_are_told(tmp_path: Path) -> None:
    """s counts along the slope, a map does not."""
    made = make_track(Wanted(write_dem(tmp_path / "dem.tif", plane), write_line(tmp_path / "l.gpkg", DOWN)))
    profile = made["profile"]
    lengths = f"{profile['s_m'][-1]:.0f} m long along the slope and {profile['x_m'][-1]:.0f} m on the map"
    assert any(lengths in line for line in track_statement(made))


def test_a_prediction_knows_where_its_track_is_from(tmp_path: Path) -> None:
    line = write_line(tmp_path / "line.gpkg", DOWN)
    made = make_track(Wanted(write_dem(tmp_path / "dem.tif", plane), line))
    table, beside = tmp_path / "track.csv", tmp_path / "track.json"
    table.write_text(track_table(made))
    track = read_track(table)
    assert track_origin(table, track)["made_from"] is None
    beside.write_text(json.dumps(made))
    origin = track_origin(table, track)
    assert origin["sha256"] == hashlib.sha256(table.read_bytes()).hexdigest()
    assert origin["made_from"]["terrain"]["file"] == "dem.tif"
    assert origin["made_from"]["line"]["sha256"] == hashlib.sha256(line.read_bytes()).hexdigest()
    assert origin["made_from"]["reference_system"].startswith("EPSG:")
    for other in ("{}", "[", json.dumps({**made, "profile": {**made["profile"], "z_m": [1.0]}})):
        beside.write_text(other)
        assert track_origin(table, track)["made_from"] is None
