"""Places as x, altitude or distance from a reference become arc lengths; what is ambiguous is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from import_cases import TRACK, options, skred, wide_file, without_bounds
from small_campaign import TEXTS, write_texts

from skred.campaign import Track, read_campaign
from skred.campaign.cells import CellError
from skred.importing.places import Places

BUMPY = Track([0, 100, 200, 300, 400], [100, 50, 60, 10, 10])


@given(st.floats(0, 300))
def test_x_and_altitude_of_one_place_are_one_arc_length(x_m: float) -> None:
    track = Track([0, 60, 120, 180, 300], [300, 220, 140, 110, 100])
    places = Places(track, None)
    altitude = float(np.interp(x_m, track.x_m, track.z_m))
    by_x = places.arc_length(x_m, "x")
    np.testing.assert_allclose(places.arc_length(altitude, "altitude"), by_x, atol=1e-6)
    step = int(np.searchsorted(track.x_m, x_m, side="right")) - 1
    expected = track.s_m[step] + np.hypot(x_m - track.x_m[step], altitude - track.z_m[step])
    np.testing.assert_allclose(by_x, expected, atol=1e-9)


@pytest.mark.parametrize("altitude", [50, 55, 60, 10])
def test_an_altitude_at_several_places_is_refused(altitude: float) -> None:
    with pytest.raises(CellError, match="at several places, s = .*give the place as s or x"):
        Places(BUMPY, None).arc_length(altitude, "altitude")


@pytest.mark.parametrize(
    ("value", "place"), [(9, "altitude"), (101, "altitude"), (-1, "x"), (401, "x"), (5, "reference")]
)
def test_places_that_are_not_there_are_refused(value: float, place: str) -> None:
    with pytest.raises(CellError):
        Places(BUMPY, None).arc_length(value, place)


def test_standard_deviations_are_as_long_as_the_ground_is_gentle() -> None:
    straight = Track([0, 400, 800, 1200], [100, 80, 60, 40])
    along = np.hypot(400, 20) / 20
    np.testing.assert_allclose(Places(straight, None).sd_along(70, 3, "altitude"), 3 * along)
    np.testing.assert_allclose(Places(straight, None).sd_along(600, 8, "x"), 8 * np.hypot(400, 20) / 400)
    assert Places(straight, 50.0).sd_along(600, 8, "reference") == 8


def test_standard_deviations_do_not_shrink_at_the_ends_of_the_track() -> None:
    """The last altitude above the end, and the end itself, are known as well as those before."""
    track = Track([0, 100, 500], [160, 80, 60])
    places = Places(track, None)
    per_metre = {"steep": np.hypot(100, 80) / 80, "gentle": np.hypot(400, 20) / 20}
    for altitude in (64, 63, 61, 60):
        np.testing.assert_allclose(places.sd_along(altitude, 4, "altitude"), 4 * per_metre["gentle"])
    for altitude in (150, 157, 160):
        np.testing.assert_allclose(places.sd_along(altitude, 6, "altitude"), 6 * per_metre["steep"])
    for x_m in (100 + 390, 500):
        np.testing.assert_allclose(places.sd_along(x_m, 20, "x"), 20 * np.hypot(400, 20) / 400)


def test_standard_deviations_beside_an_end_are_at_least_as_long_as_the_track_there() -> None:
    """A gentle stretch below a steep one, cut off by the end: what is seen of it counts in full."""
    track = Track([0, 100, 500], [160, 62, 60])
    seen, above = np.hypot(400, 2), 6 * np.hypot(100, 98) / 98
    sd = Places(track, None).sd_along(62, 6, "altitude")
    np.testing.assert_allclose(sd, (seen + above) / 2)
    # More than the whole track is within one standard deviation: no side tells of what lies beyond.
    np.testing.assert_allclose(Places(track, None).sd_along(110, 900, "altitude"), track.s_m[-1] / 2)


@pytest.mark.parametrize(
    ("kind", "value"), [("altitude", "105"), ("x", "240"), ("reference", "227.0"), ("s", "327.0")]
)
def test_runouts_of_the_five_files(
    kind: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings = TEXTS["recordings.csv"].replace("stop,320,", f"stop,{value},")
    recordings = recordings.replace("second,stop,180,20,observed\n", "")
    folder = write_texts(tmp_path / "in", {**TEXTS, "recordings.csv": recordings})
    code, _, err = skred(capsys, "import", folder, "--runout", kind, "--out", tmp_path / "out")
    assert code == 0, err
    track = read_campaign(tmp_path / "out").track
    middle = (track.s_m[3] + track.s_m[4]) / 2
    np.testing.assert_allclose(read_campaign(tmp_path / "out").values[0, 3], middle, atol=0.5)


def test_an_ambiguous_altitude_names_the_cell(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    track.write_text(TRACK.replace("180,110", "180,150"))
    rows = without_bounds()
    rows[0][3] = "Runout altitude"
    rows[1][3], rows[2][3], rows[3][3] = "145", "110", ""
    file = wide_file(tmp_path, rows)
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and not (tmp_path / "out").exists()
    assert (
        "table.csv, row 2, column Runout altitude: found '145': the track has this altitude at several places"
        in err
    )


def test_a_profile_of_a_gis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = TRACK.splitlines()
    profile = ["distance,elevation,slope", *(",".join([*line.split(",")[:2], "1"]) for line in lines[1:])]
    folder = write_texts(tmp_path / "in", {**TEXTS, "track.csv": "\n".join(profile)})
    arguments = ["import", folder, "--out", tmp_path / "out"]
    code, out, err = skred(capsys, *arguments)
    assert code == 2 and "'distance', 'elevation'" in err and "--set track.x=distance" in err
    assert "track: horizontal" in out and not (tmp_path / "out").exists()
    code, _, err = skred(capsys, *arguments, "--set", "track.x=distance", "--set", "track.z=elevation")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").track.x_m.tolist() == [0, 60, 120, 180, 300]
