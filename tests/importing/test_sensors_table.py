"""The sensors' table beside a wide one: what its format refuses is told by row and column."""

from __future__ import annotations

from pathlib import Path

import pytest
from import_cases import options, skred, wide_file

from skred.campaign import read_campaign

ROWS = [["event", "high [m/s]", "stop"], ["a", "21.5", "240"], ["b", "17", "210"]]
HEADER = "sensor;quantity;s_from_m;s_to_m;relative_sd;absolute_sd"
SENSORS = ["high;front_velocity;110;110;0,08;1", "stop;runout;;;0;15"]


def imported(
    capsys: pytest.CaptureFixture[str],
    folder: Path,
    sensors: list[str],
    *more: str,
    header: str = HEADER,
) -> tuple[int, str]:
    """Import the table with these sensors."""
    file = folder / "gauges.csv"
    file.write_text("\n".join([header, *sensors]) + "\n", encoding="utf-8")
    declared = [*options("event=event"), "--runout", "s", *more]
    arguments = ["--track", folder / "profile.csv", "--sensors", file, *declared]
    code, _, err = skred(
        capsys, "import", wide_file(folder, ROWS), *arguments, "--out", folder / "out", "--force"
    )
    return code, err


@pytest.mark.parametrize(
    ("sensors", "told"),
    [
        ([*SENSORS, "high;front_velocity;130;130;0,1;1"], "row 4, column sensor: found 'high': the id"),
        ([SENSORS[0].replace("0,08", "-0,08"), SENSORS[1]], "row 2, column relative_sd: found '-0,08': "),
        ([SENSORS[0], "stop;runout;;;0;-15"], "row 3, column absolute_sd: found '-15': expected 0 or a"),
        ([SENSORS[0].replace("high", ""), SENSORS[1]], "row 2, column sensor: found '': the cell is empty"),
        ([SENSORS[0], "stop;stop;;;0;15"], "row 3, column quantity: found 'stop': expected 'front_velocity'"),
        ([SENSORS[0].replace("110;110", "9000;9000"), SENSORS[1]], "row 2, column s_from_m: found"),
        ([SENSORS[0].replace("110;110", "110;"), SENSORS[1]], "row 2, column s_to_m: found"),
        ([SENSORS[0], "stop;runout;3;;0;15"], "row 3, column s_from_m: found '3': a runout sensor has no"),
        ([SENSORS[0].replace("110", "here"), SENSORS[1]], "row 2, column s_from_m: found 'here'"),
    ],
)
def test_what_is_wrong_with_a_sensor_is_told(
    sensors: list[str], told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, err = imported(capsys, tmp_path, sensors)
    assert code == 2 and f"gauges.csv, {told}" in err, err
    assert not (tmp_path / "out").exists()


def test_every_problem_is_told_at_once(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, err = imported(capsys, tmp_path, [SENSORS[0].replace("0,08", "-1"), "stop;halt;;;0;15"])
    assert code == 2 and "row 2, column relative_sd" in err and "row 3, column quantity" in err


def test_a_misspelt_column_is_no_column_of_sensors(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sensors = [f"{row};2,5" if row.startswith("high") else f"{row};" for row in SENSORS]
    code, err = imported(capsys, tmp_path, sensors, header=f"{HEADER};place_sd")
    assert code == 2 and "gauges.csv, row 1, column place_sd: unknown column; expected sensor" in err
    code, err = imported(capsys, tmp_path, sensors, header=f"{HEADER};place_sd_m")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").sensors[0].place_sd_m == 2.5
    code, err = imported(capsys, tmp_path, SENSORS, header=HEADER.replace("absolute_sd", "sd"))
    assert (
        code == 2 and "row 1, column sd: unknown column" in err and "columns absolute_sd are missing" in err
    )


def test_a_blank_sd_is_asked_about(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blank = [SENSORS[0].replace("0,08;1", ";"), SENSORS[1]]
    code, err = imported(capsys, tmp_path, blank)
    assert code == 0, err  # `options` declares both for every velocity
    sensor = read_campaign(tmp_path / "out").sensors[0]
    assert (sensor.relative_sd, sensor.absolute_sd) == (0.1, 1)


def test_the_decimal_sign_can_be_declared(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    doubtful = ["high;front_velocity;110;110;0;1.125", "stop;runout;;;0;15"]
    code, err = imported(capsys, tmp_path, doubtful)
    assert code == 2 and "gauges.csv, row 2, column absolute_sd: '1.125' can be" in err
    code, err = imported(capsys, tmp_path, doubtful, "--decimal", ".")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").sensors[0].absolute_sd == 1.125
