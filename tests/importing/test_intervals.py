"""Bounds and intervals in wide tables: a word, a sign, two numbers in a cell, two columns."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from import_cases import COLUMNS, options, same, skred, wide_file, without_bounds
from small_campaign import TEXTS, write_texts

from skred.campaign import Status, read_campaign
from skred.campaign.cells import CellError, number
from skred.campaign.problems import CampaignError
from skred.importing.numbers import Notation, notation_of
from skred.importing.questions import Unclear
from skred.importing.readings import number_of


@pytest.mark.parametrize(
    ("cell", "read"),
    [
        ("12-18", ("between", "12", "18")),
        ("12\u201318", ("between", "12", "18")),
        ("12 \u2013 18", ("between", "12", "18")),
        ("12 to 18", ("between", "12", "18")),
        ("between 12 and 18", ("between", "12", "18")),
        ("zwischen 12 und 18", ("between", "12", "18")),
        ("12...18", ("between", "12", "18")),
        ("-20 - -10", ("between", "-20", "-10")),
        ("-20--10", ("between", "-20", "-10")),
        ("<= 18", ("at_most", "18", "")),
        ("at most 18", ("at_most", "18", "")),
        ("up to 18", ("at_most", "18", "")),
        ("\u2265 18.5", ("at_least", "18.5", "")),
        ("-18", ("observed", "-18", "")),
    ],
)
def test_cells(cell: str, read: tuple[str, str, str]) -> None:
    reading = number_of(cell, Notation())
    assert (reading.status, reading.value, reading.value_to) == read


def test_decimal_commas_thousands_and_a_standard_deviation() -> None:
    reading = number_of("1 140,5 \u2013 1 160 \u00b1 2,5", Notation(",", " "))
    assert (reading.value, reading.value_to, reading.sd) == ("1140.5", "1160", "2.5")


@pytest.mark.parametrize(
    ("cell", "told"),
    [
        ("12-12", "both ends of the interval are the same"),
        (">= 12-18", "a bound is one number"),
        ("2026-12-18", "a date stands here"),
        ("12-18-20", "expected one number"),
        ("1e-5 to", "expected one number"),
        ("12 til", "'til' is no part of a number"),
        ("1" + " " * 100_000 + "x", "'x' is no part of a number"),
    ],
)
def test_what_is_no_interval(cell: str, told: str) -> None:
    with pytest.raises(CellError, match=told):
        number_of(cell, Notation())


@pytest.mark.parametrize(
    "cell", ["1" + " " * 100_000 + "x", "1" + ",111" * 25_000 + "x", "1" * 100_000 + "-", "+-" * 50_000]
)
def test_a_long_cell_takes_no_time(cell: str) -> None:
    """Patterns whose time grows with the square of a cell's length would take half a minute here."""
    begun = time.process_time()
    with pytest.raises(CellError):
        number_of(cell, Notation())
    with pytest.raises(CellError):
        number(cell)
    with contextlib.suppress(Unclear, CampaignError):
        notation_of([(1, "speed", cell)], "speeds.csv", ";", (None, None), ("table",))
    assert time.process_time() - begun < 2.0


@given(st.floats(-900, 1e6), st.floats(-900, 1e6))
def test_any_two_numbers(low: float, high: float) -> None:
    one, other = f"{low:.3f}", f"{high:.3f}"
    assume(float(one) != float(other))
    for between in (" to ", " - ", "..."):
        reading = number_of(f"{one}{between}{other}", Notation())
        assert (reading.status, reading.value, reading.value_to) == ("between", one, other)


def imported(
    capsys: pytest.CaptureFixture[str], folder: Path, rows: list[list[str]], *more: object
) -> tuple[int, str]:
    arguments = ["--track", folder / "profile.csv", *options(), *more, "--out", folder / "out", "--force"]
    code, _, err = skred(capsys, "import", wide_file(folder, rows), *arguments)
    return code, err


def test_every_kind_of_bound_in_a_table(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        ["Date", "v upper [m/s]", "v lower [m/s]", "Runout s [m]"],
        ["a", "25\u201330", ">= 8", "310-320 \u00b1 2"],
        ["b", "<= 25", "8", "300 to 290"],
        ["c", "24", "-", ">= 250"],
    ]
    code, err = imported(capsys, tmp_path, rows)
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.status.tolist() == [
        [Status.BETWEEN, Status.AT_LEAST, Status.BETWEEN],
        [Status.AT_MOST, Status.OBSERVED, Status.BETWEEN],
        [Status.OBSERVED, Status.NOT_REACHED, Status.AT_LEAST],
    ]
    assert campaign.values[:2, 2].tolist() == [310, 290] and campaign.values_to[:2, 2].tolist() == [320, 300]
    assert campaign.stated_sd[0, 2] == 2
    mapping = tmp_path / "out" / "import.toml"
    arguments = ["import", tmp_path / "table.csv", "--mapping", mapping, "--quiet"]
    code, _, err = skred(capsys, *arguments, "--out", tmp_path / "again")
    assert (code, err) == (0, "")
    assert same(tmp_path / "out", tmp_path / "again")


def test_bounds_in_columns_of_their_own(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        ["Date", "v upper [m/s]", "runout s [m]", "runout at least [m]", "runout at most [m]"],
        ["exact", "25", "300", "", ""],
        ["between", "25", "", "290", "310"],
        ["least", "25", "-", "290", ""],
        ["most", "25", "", "", "310"],
        ["unknown", "25", "", "", ""],
    ]
    file = wide_file(tmp_path, rows)
    arguments = ["import", file, "--track", track, *options(COLUMNS[0])]
    code, _, err = skred(capsys, *arguments, "--out", tmp_path / "out")
    assert code == 0, err
    assert (tmp_path / "out" / "recordings.csv").read_text().splitlines()[2::2] == [
        "exact,runout,300,,observed",
        "between,runout,290,310,between",
        "least,runout,290,,at_least",
        "most,runout,310,,at_most",
        "unknown,runout,,,missing",
    ]
    mapping = tmp_path / "out" / "import.toml"
    assert 'bound = "at_most"' in mapping.read_text()
    arguments = ["import", file, "--mapping", mapping, "--quiet", "--out", tmp_path / "again"]
    code, _, err = skred(capsys, *arguments)
    assert (code, err) == (0, "")
    assert same(tmp_path / "out", tmp_path / "again")


def test_velocities_by_two_columns_in_km_h(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [["Date", "slow", "fast"], ["a", "72", "108"], ["b", "", "90"]]
    columns = (
        "slow=front_velocity at=100 unit=km/h sensor=mast bound=at_least",
        "fast=front_velocity sensor=mast bound=at_most",
    )
    arguments = ["import", wide_file(tmp_path, rows), "--track", track, *options(*columns)]
    code, _, err = skred(capsys, *arguments, "--out", tmp_path / "out")
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.status[:, 0].tolist() == [Status.BETWEEN, Status.AT_MOST]
    np.testing.assert_allclose([campaign.values[0, 0], campaign.values_to[0, 0]], [20, 30])


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (["a", "25", "300", "290", ""], "row 2, column runout at least [m]: found '290': the columns"),
        (["a", "25", "", "310", "290"], "column runout at most [m]: found '290': value_to must be greater"),
        (["a", "25", "", "<= 290", ""], "the column holds bounds (at_least); write the number alone"),
        (["a", "25", "", "280-290", ""], "the column holds bounds (at_least); write the number alone"),
    ],
)
def test_bounds_that_contradict(
    row: list[str], told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header = ["Date", "v upper [m/s]", "runout s [m]", "runout at least [m]", "runout at most [m]"]
    file = wide_file(tmp_path, [header, row])
    arguments = ["import", file, "--track", track, *options(COLUMNS[0]), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and told in err, err


def test_two_columns_of_one_sensor_need_their_bounds(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [["Date", "runout min s", "runout max s"], ["a", "280", "290"]]
    arguments = ["import", wide_file(tmp_path, rows), "--track", track, *DECLARED_SDS]
    code, _, err = skred(capsys, *arguments, "--out", tmp_path / "out")
    assert code == 2 and "all readings of sensor 'runout'" in err and "bound=at_least" in err
    columns = ("runout min s=runout bound=at_least sensor=r", "runout max s=runout bound=at_most sensor=r")
    declared = [word for column in columns for word in ("--column", column)]
    code, _, err = skred(capsys, *arguments, *declared, "--runout", "s", "--out", tmp_path / "out")
    assert code == 0, err
    assert "a,r,280,290,between" in (tmp_path / "out" / "recordings.csv").read_text()


DECLARED_SDS = options()[: options().index("--column")]


def test_bounds_of_altitudes_are_asked_about(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At least 120 m a.s.l. is higher up, an avalanche that came at least to 120 m is further down."""
    rows = without_bounds()
    rows[0][3] = "Runout altitude"
    for row, cell in zip(rows[1:], ("105", ">= 120", "130-120"), strict=True):
        row[3] = cell
    code, err = imported(capsys, tmp_path, rows)
    assert code == 2 and "row 3, column Runout altitude: '>= 120' as an altitude" in err
    assert "--set runout.bounds=runout|altitude" in err
    for bounds, status in (("runout", Status.AT_LEAST), ("altitude", Status.AT_MOST)):
        code, err = imported(capsys, tmp_path, rows, "--set", f"runout.bounds={bounds}")
        assert code == 0, err
        campaign = read_campaign(tmp_path / "out")
        assert campaign.status[1:, 2].tolist() == [status, Status.BETWEEN]
        low, high = campaign.values[2, 2], campaign.values_to[2, 2]
        places = np.interp([-130, -120], -np.array(campaign.track.z_m), campaign.track.s_m)
        np.testing.assert_allclose([low, high], places)


def test_bounds_of_altitudes_in_the_five_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Both ends of an interval are turned, and stand in the order of the track."""
    header, *lines = TEXTS["recordings.csv"].splitlines()
    lines = [line for line in lines if ",stop," not in line]
    head = header.split(",")
    assert "value_to" not in head
    at = head.index("value") + 1

    def with_value_to(line: str, text: str) -> str:
        cells = line.split(",")
        return ",".join([*cells[:at], text, *cells[at:]])

    rows = [with_value_to(header, "value_to"), *(with_value_to(line, "") for line in lines)]
    rows += ["first,stop,105,104,10,between", "second,stop,130,,10,at_most"]
    folder = write_texts(tmp_path / "in", {**TEXTS, "recordings.csv": "\n".join(rows) + "\n"})
    arguments = ["import", folder, "--runout", "altitude", "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "--set runout.bounds=runout|altitude" in err, err
    code, _, err = skred(capsys, *arguments, "--set", "runout.bounds=altitude")
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    stop = campaign.sensor_ids.index("stop")
    assert campaign.status[:2, stop].tolist() == [Status.BETWEEN, Status.AT_LEAST]
    assert campaign.values[0, stop] < campaign.values_to[0, stop] <= campaign.track.length_m
