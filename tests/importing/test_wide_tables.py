"""The table that papers print: units, places, bounds, blanks, dashes and words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from import_cases import COLUMNS, WIDE, options, skred, wide_file, without_bounds

from skred.campaign import Status, read_campaign


def imported(
    capsys: pytest.CaptureFixture[str],
    folder: Path,
    rows: list[list[str]],
    *more: object,
    columns: tuple[str, ...] = (),
) -> tuple[int, str]:
    """Import a wide table on the small track."""
    (folder / "profile.csv").is_file()
    arguments = ["--track", folder / "profile.csv", *options(*columns), *more]
    code, _, err = skred(
        capsys, "import", wide_file(folder, rows), *arguments, "--out", folder / "out", "--force"
    )
    return code, err


def test_statuses(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, err = imported(capsys, tmp_path, WIDE)
    assert code == 0, err
    assert (tmp_path / "out" / "recordings.csv").read_text().splitlines() == [
        "event,sensor,value,status",
        "1999-02-03,upper,30.5,observed",
        "1999-02-03,lower,10.2,observed",
        "1999-02-03,runout,320.5,observed",
        "2000-01-21,upper,20.1,observed",
        "2000-01-21,lower,,not_reached",
        "2000-01-21,runout,180,observed",
        "2002-02-27,upper,,missing",
        "2002-02-27,lower,,missing",
        "2002-02-27,runout,250,at_least",
    ]


@pytest.mark.parametrize(
    "bound", [">= 250", ">250", "≥250", "at least 250", "min. 250", "min 250", "mind. 250"]
)
def test_at_least(bound: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [*WIDE[:3], [*WIDE[3][:3], bound, *WIDE[3][4:]]]
    code, err = imported(capsys, tmp_path, rows)
    assert code == 0, err
    assert "2002-02-27,runout,250,at_least" in (tmp_path / "out" / "recordings.csv").read_text()


def test_kilometres_per_hour(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = without_bounds()
    rows[0] = [name.replace("m/s", "km/h") for name in rows[0]]
    rows[1][1] = "108 ± 7.2"
    columns = tuple(column.replace("m/s", "km/h") for column in COLUMNS)
    code, err = imported(capsys, tmp_path, rows, columns=columns)
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    np.testing.assert_allclose(campaign.values[0, :2], [30.0, 10.2 / 3.6])
    np.testing.assert_allclose(campaign.stated_sd[0, 0], 2.0)


def test_blanks_dashes_and_words_are_asked_about(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    rows[3][1] = "stopped"
    quiet = [one for one in options() if one not in ("--blank", "--dash", "missing", "not_reached")]
    file = wide_file(tmp_path, rows)
    arguments = ["import", file, "--track", track, *quiet, "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and not (tmp_path / "out").exists()
    assert (
        "table.csv, row 4, column v lower [m/s]: a blank cell" in err and "--blank missing|not_reached" in err
    )
    assert "table.csv, row 3, column v lower [m/s]: '-'" in err and "--dash missing|not_reached" in err
    assert (
        '--word "stopped=missing|not_reached"' in err
        and '[cells.words] stopped = "missing|not_reached"' in err
    )
    more = "--blank missing --dash not_reached --word stopped=not_reached".split()
    code, _, err = skred(capsys, *arguments, *more)
    assert code == 0, err
    status = read_campaign(tmp_path / "out").status
    assert status[2, :2].tolist() == [Status.NOT_REACHED, Status.MISSING]


def test_sensors_from_a_table(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = without_bounds()
    rows[0] = ["event", "upper [km/h]", "gate", "stop", "Volume [m3]", "Snow"]
    sensors = tmp_path / "my-sensors.csv"
    sensors.write_text(
        "sensor;quantity;s_from_m;s_to_m;relative_sd;absolute_sd\n"
        "upper;front_velocity;100;100;0,1;1\ngate;front_velocity;120;200;0,1;1,5\nstop;runout;;;0;10\n"
    )
    arguments = ["--sensors", sensors, "--runout", "s", "--set", "velocity.unit=m/s"]
    code, err = imported(capsys, tmp_path, rows, *arguments, columns=("Snow=ignore",))
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sensor_ids == ("upper", "gate", "stop")
    assert [sensor.s_to_m for sensor in campaign.sensors[:2]] == [100.0, 200.0]
    assert campaign.sensors[1].absolute_sd == 1.5
    np.testing.assert_allclose(campaign.values[0], [30.5 / 3.6, 10.2, 320.5])
    assert set(campaign.events[0].covariates) == {"volume_m3"}


def test_standard_deviations_and_releases_in_columns(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        ["event", "release altitude", "release_sd_m", "v [m/s]", "sd v", "runout x"],
        ["a", "300", "5", "30", "2.5", "240"],
        ["b", "260", "", "25", "", "180"],
    ]
    code, err = imported(capsys, tmp_path, rows, columns=("v [m/s]=front_velocity at=100 sensor=v",))
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert [event.release_s_m for event in campaign.events] == [0.0, 50.0]
    assert campaign.stated_sd[0, 0] == 2.5 and np.isnan(campaign.stated_sd[1, 0])
    half = (campaign.track.s_m[3] + campaign.track.s_m[4]) / 2
    np.testing.assert_allclose(campaign.values[:, 1], [half, campaign.track.s_m[3]])
    # On the first segment, 5 m of altitude are 6.25 m of track, at its first point too.
    np.testing.assert_allclose(campaign.events[0].release_sd_m, 6.25)


def test_covariates_without_a_unit_are_asked_about_once(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    rows[0][4] = "Volume"
    code, err = imported(capsys, tmp_path, rows)
    assert code == 2 and err.count("column Volume: what is it?") == 1
    code, err = imported(capsys, tmp_path, rows, "--column", "Volume=covariate name=volume_m3")
    assert code == 0, err
    events = read_campaign(tmp_path / "out").events
    assert [event.covariates["volume_m3"] for event in events] == [12000.0, 8000.5, None]


@pytest.mark.parametrize("name", ["w" * 196 + " [%]", "İ" * 150])
def test_a_covariate_whose_name_would_be_too_long_is_asked_about(
    name: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The header is as long as one may be; with its unit in words, or in small letters, it is longer."""
    rows = [[*row, "wet"] for row in without_bounds()]
    rows[0][6] = name
    code, err = imported(capsys, tmp_path, rows)
    assert code == 2 and "what is it?" in err and name[:20] in err, err
    code, err = imported(capsys, tmp_path, rows, "--column", f"{name}=covariate name=wetness")
    assert code == 0, err


def test_covariates_of_one_name_are_told_by_their_columns(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [[*row, "3"] for row in without_bounds()]
    rows[0][6] = "volume [m³]"
    code, err = imported(capsys, tmp_path, rows)
    told = "table.csv, row 1, column volume [m³]: it would be called 'volume_m3', as is column 'Volume [m3]'"
    assert code == 2 and told in err, err
    code, err = imported(capsys, tmp_path, rows, "--column", "volume [m³]=covariate name=fracture_volume_m3")
    assert code == 0, err
    code, err = imported(capsys, tmp_path, rows, "--column", "volume [m³]=covariate name=release_sd_m")
    assert code == 2 and "'release_sd_m', as is the column of that name in events.csv" in err


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({(1, 1): "ca. 30"}, "row 2, column v upper [m/s]: found 'ca. 30'"),
        ({(1, 3): "900"}, "row 2, column Runout s [m]: found '900': expected an arc length on the track"),
        ({(2, 0): "1999-02-03"}, "row 3, column Date: found '1999-02-03': the id already stands in row 2"),
        ({(2, 0): ""}, "row 3, column Date: found '': the cell is empty"),
        ({(1, 1): "-30"}, "row 2, column v upper [m/s]: found '-30': a front velocity is not negative"),
        ({(0, 5): "Date"}, "column Date: the name also stands in column 1"),
        ({(1, 1): "30±2±3"}, "row 2, column v upper [m/s]: found '30±2±3'"),
        ({(1, 4): "many"}, "row 2, column Volume [m3]: found 'many'"),
    ],
)
def test_problems_name_the_cell_of_the_table(
    change: dict[tuple[int, int], str],
    told: str,
    tmp_path: Path,
    track: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = without_bounds()
    for (row, column), text in change.items():
        rows[row][column] = text
    code, err = imported(capsys, tmp_path, rows)
    assert code == 2 and f"table.csv, {told}" in err.replace("row 1, column Date: the", "column Date: the"), (
        err
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (("--column", "nowhere=event"), "no column of that name; there are: 'Date'"),
        (("--column", "Snow=snowy"), "key columns.Snow.is"),
        (("--column", "Snow=front_velocity at"), "expected a kind and key=value"),
        (("--column", "Snow=covariate at=3"), "a column that is 'covariate' has no at"),
        (("--column", "Snow=front_velocity from=3"), "a span needs both"),
        (("--column", "Snow=event"), "columns Date, Snow: exactly one names the avalanches"),
        (("--column", "Snow=sd of=who"), "of='who' is no sensor"),
        (("--set", "nothing.here=1"), "key nothing: no such key"),
        (("--set", "velocity.relative_sd=-1"), "key velocity.relative_sd: found '-1'"),
        (("--set", "velocity"), "expected KEY=VALUE"),
        (("--word", "stopped=perhaps"), "key cells.words.stopped"),
        (("--runout", "reference"), ""),
        (("--set", "table.header_row=77"), "row 77 is empty or not there"),
    ],
)
def test_wrong_declarations_are_told(
    more: tuple[str, ...], told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, err = imported(capsys, tmp_path, without_bounds(), *more)
    assert (code == 2 and told in err) if told else code == 0, err
