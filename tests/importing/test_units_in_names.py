"""Units in the names of columns: those that a reading has are used, all others are asked about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from import_cases import options, skred, wide_file

from skred.campaign import read_campaign
from skred.importing.meaning import recognised

SENSORS = (
    "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\n"
    "mast,front_velocity,140,140,0.07,2\nrest,runout,,,0,9\n"
)


def imported(
    capsys: pytest.CaptureFixture[str],
    folder: Path,
    header: list[str],
    row: list[str],
    *more: object,
    columns: tuple[str, ...] = ("event=event",),
) -> tuple[int, str]:
    """Import a table of one avalanche."""
    file = wide_file(folder, [header, row])
    arguments = ["--track", folder / "profile.csv", *options(*columns), "--runout", "s", *more]
    code, _, err = skred(capsys, "import", file, *arguments, "--out", folder / "out", "--force")
    return code, err


def with_sensors(folder: Path) -> tuple[object, ...]:
    """The option that gives the table of sensors."""
    (folder / "gauges.csv").write_text(SENSORS)
    return "--sensors", folder / "gauges.csv"


@pytest.mark.parametrize(
    ("name", "value", "metres"),
    [
        ("runout_km", "0.24", 240),
        ("runout km", "0.24", 240),
        ("runout [km]", "0.24", 240),
        ("Run-out (m)", "240", 240),
        ("runout distance [m]", "240", 240),
        ("Auslauflänge [m]", "240", 240),
        ("runout_s_m", "240", 240),
        ("stopped at", "240", 240),
    ],
)
def test_metres_and_kilometres(
    name: str, value: str, metres: float, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, err = imported(capsys, tmp_path, ["event", name], ["a", value])
    assert code == 0, err
    np.testing.assert_allclose(read_campaign(tmp_path / "out").values, [[metres]])


@pytest.mark.parametrize("name", ["runout [ft]", "runout_ft", "runout (°)", "runout [mi]", "runout_cm"])
def test_other_units_of_a_runout_are_asked_about(
    name: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where a unit was declared of all runouts: this name says something else."""
    code, err = imported(capsys, tmp_path, ["event", name], ["a", "240"], "--set", "runout.unit=m")
    assert code == 2 and f"table.csv, column {name}: its unit '" in err and "is none of m, km" in err, err
    assert f'--column "{name}=runout sensor=runout unit=m|km"' in err
    assert not (tmp_path / "out").exists()
    declared = ("event=event", f"{name}=runout")
    code, err = imported(capsys, tmp_path, ["event", name], ["a", "240"], columns=declared)
    assert code == 2 and f'--column "{name}=runout unit=m|km"' in err
    code, err = imported(
        capsys, tmp_path, ["event", name], ["a", "240"], columns=("event=event", f"{name}=runout unit=m")
    )
    assert code == 0, err


@pytest.mark.parametrize(
    "name", ["runout volume [m³]", "stop time [s]", "runout width [m]", "Auslaufwinkel [°]"]
)
def test_what_only_begins_like_a_runout_is_none(
    name: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    column = recognised(name, ["300"])
    assert column is not None and column.is_ == "covariate"
    code, err = imported(capsys, tmp_path, ["event", "runout [m]", name], ["a", "240", "300"])
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sensor_ids == ("runout",) and list(campaign.events[0].covariates.values()) == [300.0]


@pytest.mark.parametrize(
    ("name", "unit", "known"),
    [
        ("mast [mph]", "mph", "front_velocity sensor=mast at=140 place=s relative_sd=0.07 absolute_sd=2"),
        ("mast_mph", "mph", "front_velocity sensor=mast at=140 place=s relative_sd=0.07 absolute_sd=2"),
        ("mast (°C)", "°C", "front_velocity sensor=mast at=140 place=s relative_sd=0.07 absolute_sd=2"),
        ("rest [ft]", "ft", "runout sensor=rest relative_sd=0 absolute_sd=9"),
        ("rest_ft", "ft", "runout sensor=rest relative_sd=0 absolute_sd=9"),
        ("rest altitude [ft]", "ft", "runout sensor=rest place=altitude relative_sd=0 absolute_sd=9"),
    ],
)
def test_other_units_of_a_sensor_are_asked_about(
    name: str,
    unit: str,
    known: str,
    tmp_path: Path,
    track: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    more = (*with_sensors(tmp_path), "--set", "velocity.unit=m/s")
    row = "20" if "velocity" in known else "120"
    code, err = imported(capsys, tmp_path, ["event", name], ["a", row], *more)
    assert code == 2 and f"column {name}: its unit '{unit}' is none of" in err, err
    units = "m/s|km/h" if "velocity" in known else "m|km"
    assert f'--column "{name}={known} unit={units}"' in err, err
    # The line is taken as it stands, once one of the units is left.
    answer = f"{name}={known} unit={units.split('|')[0]}"
    code, err = imported(capsys, tmp_path, ["event", name], ["a", row], *more, "--column", answer)
    assert code == 0, err
    assert read_campaign(tmp_path / "out").sensor_ids == (known.split()[1].removeprefix("sensor="),)


def test_a_unit_in_the_name_counts_more_than_that_of_all_columns(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, row = ["event", "mast [m/s]", "rest [m]"], ["a", "18", "240"]
    more = (*with_sensors(tmp_path), "--set", "velocity.unit=km/h", "--set", "runout.unit=km")
    code, err = imported(capsys, tmp_path, header, row, *more)
    assert code == 0, err
    np.testing.assert_allclose(read_campaign(tmp_path / "out").values, [[18, 240]])


def test_a_sensor_whose_id_looks_like_a_property_is_a_sensor(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In ``mast_1`` the end is no unit (a pure number): its column has just the sensor's id."""
    option, file = with_sensors(tmp_path)
    assert isinstance(file, Path)
    file.write_text(SENSORS.replace("mast", "mast_1"))
    more = (option, file, "--set", "velocity.unit=m/s")
    code, err = imported(capsys, tmp_path, ["event", "mast_1"], ["a", "18"], *more)
    assert code == 0, err
    assert read_campaign(tmp_path / "out").sensor_ids == ("mast_1",)


@pytest.mark.parametrize(
    ("reading", "name", "sd"),
    [
        ("v [km/h]", "sd v [m/s]", 1.5),
        ("v [km/h]", "sd_v (km/h)", 1.5 / 3.6),
        ("v [m/s]", "v sd [km/h]", 1.5 / 3.6),
        ("v [m/s]", "sd v", 1.5),
    ],
)
def test_standard_deviations_have_units_of_their_own(
    reading: str, name: str, sd: float, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, row = ["event", reading, name], ["a", "36", "1.5"]
    columns = ("event=event", f"{reading}=front_velocity at=90 sensor=v")
    code, err = imported(capsys, tmp_path, header, row, columns=columns)
    assert code == 0, err
    np.testing.assert_allclose(read_campaign(tmp_path / "out").stated_sd, [[sd]])
    mapping, track_file = tmp_path / "out" / "import.toml", tmp_path / "profile.csv"
    arguments = ["--mapping", mapping, "--track", track_file, "--out", tmp_path / "again", "--quiet"]
    code, _, err = skred(capsys, "import", tmp_path / "table.csv", *arguments)
    assert (code, err) == (0, "")
    np.testing.assert_allclose(read_campaign(tmp_path / "again").stated_sd, [[sd]])


def test_the_sd_of_a_runout_in_kilometres(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, sd in (("sd runout [m]", 25.0), ("sd runout [km]", 25_000.0)):
        code, err = imported(capsys, tmp_path, ["event", "runout [km]", name], ["a", "0.24", "25"])
        assert code == 0, err
        np.testing.assert_allclose(read_campaign(tmp_path / "out").stated_sd, [[sd]])
    rows = ["event", "runout [km]", "sd runout"], ["a", "0.24", "25"]
    code, err = imported(capsys, tmp_path, *rows)
    assert code == 2 and "column sd runout: the unit of these standard deviations; the readings of" in err
    assert '--column "sd runout=sd of=runout unit=m|km"' in err and not err.count("what is it?")
    code, err = imported(capsys, tmp_path, *rows, "--column", "sd runout=sd of=runout unit=m")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").stated_sd.tolist() == [[25.0]]


@pytest.mark.parametrize("unit", ["%", "mph", "ft"])
def test_other_units_of_standard_deviations_are_asked_about(
    unit: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, row = ["event", "v [km/h]", f"sd v [{unit}]"], ["a", "54", "3"]
    columns = ("event=event", "v [km/h]=front_velocity at=90 sensor=v")
    code, err = imported(capsys, tmp_path, header, row, columns=columns)
    assert code == 2 and f"column sd v [{unit}]: its unit '{unit}' is none of m/s, km/h" in err, err
    assert "relative_sd= of 'v'" in err and f'--column "sd v [{unit}]=sd of=v unit=m/s|km/h' in err
    code, err = imported(capsys, tmp_path, header, row, columns=(*columns, f"sd v [{unit}]=sd of=v unit=m"))
    assert code == 2 and "its unit is m, and sensor 'v' is a front_velocity: expected m/s or km/h" in err


def test_the_unit_of_standard_deviations_is_shown(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = wide_file(tmp_path, [["event", "v [km/h]", "sd v [m/s]"], ["a", "36", "1.5"]])
    columns = [word for word in options("v [km/h]=front_velocity at=90 sensor=v") if word != "--quiet"]
    _, out, _ = skred(capsys, "import", file, "--track", track, *columns)
    [line] = [line for line in out.splitlines() if "sd v [m/s]" in line]
    assert line.count("m/s") == 2, line


def test_speeds_named_as_the_format_names_units(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """``_m_s`` and ``_km_h`` are no covariates in seconds and hours."""
    header, row = ["event", "high_m_s", "low km_h", "runout_s_m"], ["a", "21", "36", "240"]
    code, err = imported(capsys, tmp_path, header, row)
    assert code == 2 and "column high_m_s: a front velocity: where is its sensor?" in err, err
    assert '--column "high_m_s=front_velocity at=PLACE unit=m/s"' in err
    assert '--column "low km_h=front_velocity at=PLACE unit=km/h"' in err
    columns = ("event=event", "high_m_s=front_velocity at=90", "low km_h=front_velocity at=150")
    code, err = imported(capsys, tmp_path, header, row, columns=columns)
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sensor_ids == ("high", "low", "runout") and not campaign.events[0].covariates
    np.testing.assert_allclose(campaign.values, [[21, 10, 240]])


def test_a_sensor_is_found_by_a_name_with_the_formats_unit(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, row = ["event", "mast_km_h", "sd_mast_m_s", "rest_m"], ["a", "72", "3", "240"]
    code, err = imported(capsys, tmp_path, header, row, *with_sensors(tmp_path))
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    np.testing.assert_allclose(campaign.values, [[20, 240]])
    assert campaign.stated_sd[0, 0] == 3


def test_other_speeds_stay_what_they_are(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The format's own columns of release speeds; a wind can only be told by its owner."""
    header = ["event", "release_s_m", "release_speed_m_s", "release_speed_sd_m_s", "runout [m]"]
    row = ["a", "20", "4", "0.5", "240"]
    code, err = imported(capsys, tmp_path, header, row)
    assert code == 0, err
    event = read_campaign(tmp_path / "out").events[0]
    assert (event.release_speed_m_s, event.release_speed_sd_m_s) == (4, 0.5)
    header[3], row[3] = "wind_speed_m_s", "11"
    code, err = imported(capsys, tmp_path, header, row)
    assert code == 2 and "column wind_speed_m_s" in err and "covariate name=NAME_UNIT" in err
    wind = ("event=event", "wind_speed_m_s=covariate name=wind_speed_m_s")
    code, err = imported(capsys, tmp_path, header, row, columns=wind)
    assert code == 0, err
    assert read_campaign(tmp_path / "out").events[0].covariates == {"wind_speed_m_s": 11}
