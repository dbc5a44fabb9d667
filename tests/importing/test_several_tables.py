"""Several wide tables in one import: other columns of the same avalanches, or other avalanches."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest
from import_cases import (
    DECLARED,
    WIDE,
    options,
    same,
    skred,
    wide_file,
    with_decimal,
    without_bounds,
    workbook,
    written,
)

from skred.campaign import read_campaign
from skred.importing import read_mapping

Rows = list[list[str]]
SPEEDS = [[row[0], row[1], row[2], row[5]] for row in without_bounds()]
RUNOUTS = [[row[0], row[3], row[4]] for row in without_bounds()]
SEASON = [
    without_bounds()[0],
    ["2003-03-14", "28.5", "7.25", "300", "5000", "wet"],
    ["2004-01-02", "19.5", "-", "150", "", "dry"],
]


def imported(
    capsys: pytest.CaptureFixture[str], folder: Path, tables: list[Path], *more: object, out: str = "out"
) -> tuple[int, str]:
    """Import tables on the small track."""
    arguments = ["--track", folder / "profile.csv", *options(), *more, "--out", folder / out, "--force"]
    code, _, err = skred(capsys, "import", *tables, *arguments)
    return code, err


def whole(capsys: pytest.CaptureFixture[str], folder: Path, rows: Rows) -> Path:
    """The campaign of one table."""
    code, err = imported(capsys, folder, [wide_file(folder, rows, "whole.csv")], out="whole")
    assert code == 0, err
    return folder / "whole"


def test_speeds_and_runouts_in_two_tables(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rows in another order, another separator and another decimal sign."""
    speeds = wide_file(tmp_path, with_decimal(SPEEDS, ","), "speeds.csv", separator=";")
    runouts = wide_file(tmp_path, [RUNOUTS[0], *RUNOUTS[:0:-1]], "runouts.csv")
    code, err = imported(capsys, tmp_path, [speeds, runouts])
    assert code == 0, err
    one, two = read_campaign(whole(capsys, tmp_path, without_bounds())), read_campaign(tmp_path / "out")
    assert one.values[:, [0, 1, 2]].tolist().__repr__() == two.values.tolist().__repr__()
    assert one.status.tolist() == two.status.tolist() and one.sensors == two.sensors
    assert [dict(event.covariates) for event in one.events] == [
        dict(event.covariates) for event in two.events
    ]


def test_two_seasons_of_one_layout(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = wide_file(tmp_path, without_bounds(), "1999.csv")
    second = wide_file(tmp_path, with_decimal(SEASON, ","), "2003.csv", separator=";")
    code, err = imported(capsys, tmp_path, [first, second])
    assert code == 0, err
    assert same(tmp_path / "out", whole(capsys, tmp_path, [*without_bounds(), *SEASON[1:]]))
    mapping = tmp_path / "out" / "import.toml"
    assert read_mapping(mapping).tables["2003"].decimal == ","
    track.unlink()
    code, _, err = skred(
        capsys, "import", first, second, "--mapping", mapping, "--quiet", "--out", tmp_path / "again"
    )
    assert (code, err) == (0, "")
    assert same(tmp_path / "out", tmp_path / "again")
    assert (tmp_path / "again" / "import.toml").read_text() == mapping.read_text()


def test_files_of_one_name_in_two_folders(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, rows in (("a", without_bounds()), ("b", SEASON)):
        (tmp_path / name).mkdir()
        wide_file(tmp_path / name, rows)
    tables = [tmp_path / "a" / "table.csv", tmp_path / "b" / "table.csv"]
    code, err = imported(capsys, tmp_path, tables)
    assert code == 0, err
    (tmp_path / "b" / "table.csv").write_text(written([SEASON[0], ["x", "3 fast", "1", "1", "", ""]]))
    code, err = imported(capsys, tmp_path, tables)
    assert code == 2 and "b/table.csv, row 2, column v upper [m/s]: found '3 fast'" in err


def test_sheets_of_a_workbook(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    book = workbook(tmp_path / "book.xlsx", {"1999": without_bounds(), "2003": SEASON})
    code, err = imported(capsys, tmp_path, [book])
    assert code == 2 and "the sheets 1999, 2003; which of them? (* for all" in err
    code, err = imported(capsys, tmp_path, [book], "--sheet", "*")
    assert code == 0, err
    both = whole(capsys, tmp_path, [*without_bounds(), *SEASON[1:]])
    assert same(tmp_path / "out", both)
    code, err = imported(capsys, tmp_path, [book], "--sheet", "1999", "--sheet", "2003", out="named")
    assert code == 0, err
    assert same(tmp_path / "named", both)
    assert read_mapping(tmp_path / "named" / "import.toml").table.sheets == ("1999", "2003")
    code, err = imported(capsys, tmp_path, [book], "--sheet", "1999", "--sheet", "2005")
    assert code == 2 and "no sheet named '2005'" in err


def test_columns_of_one_name_and_different_meanings(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another season's gauge stood elsewhere: it is another sensor, in the mapping file too."""
    first = wide_file(tmp_path, [row[:2] for row in without_bounds()[:3]], "1999.csv")
    second = wide_file(tmp_path, [row[:2] for row in SEASON], "2003.csv")
    column = ("--column", "v upper [m/s]=front_velocity at=100 unit=m/s sensor=upper")
    other = 'tables.2003.columns."v upper [m/s]"=front_velocity at=150 unit=m/s sensor=moved'
    arguments = ["import", first, second, "--track", track, *DECLARED]
    code, _, err = skred(capsys, *arguments, *column, "--set", other, "--out", tmp_path / "out")
    assert code == 0, err
    campaign = read_campaign(tmp_path / "out")
    assert campaign.sensor_ids == ("upper", "moved")
    assert [sensor.s_from_m for sensor in campaign.sensors] == [100, 150]
    mapping = tmp_path / "out" / "import.toml"
    arguments = ["import", first, second, "--mapping", mapping, "--quiet"]
    code, _, err = skred(capsys, *arguments, "--out", tmp_path / "again")
    assert (code, err) == (0, "")
    assert same(tmp_path / "out", tmp_path / "again")


def test_releases_in_one_table(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    starts = [["Date", "release s"], ["1999-02-03", "5"], ["2000-01-21", "12"], ["2002-02-27", "0"]]
    tables = [
        wide_file(tmp_path, without_bounds(), "speeds.csv"),
        wide_file(tmp_path, starts, "starts.csv"),
    ]
    code, err = imported(capsys, tmp_path, tables)
    assert code == 0, err
    assert [event.release_s_m for event in read_campaign(tmp_path / "out").events] == [5, 12, 0]
    wide_file(tmp_path, starts[:3], "starts.csv")
    at = options().index("release.s_m=0")
    undeclared = [*options()[: at - 1], *options()[at + 1 :]]
    arguments = ["import", *tables, "--track", track, *undeclared, "--out", tmp_path / "more"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "speeds.csv, row 4, column Date: '2002-02-27' is in no table with releases" in err
    wide_file(tmp_path, [*starts[:3], ["2002-02-27", "350"]], "starts.csv")
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "speeds.csv, row 4" in err and "starts.csv, row 4" in err, err


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (
            [["Date", "Volume [m3]", "Runout s [m]"], ["1999-02-03", "7", ""]],
            "b.csv, row 2, column Volume [m3]: found '7': a.csv, row 2 says '12000'; correct one",
        ),
        (
            [["Date", "Runout s [m]"], ["1999-02-03", "300"]],
            "b.csv, row 2, column Runout s [m]: found '300': a.csv, row 2 says '320.5'; correct one",
        ),
        (
            [["Date", "Runout s [m]"], ["new", "300"], ["new", "310"]],
            "b.csv, row 3, column Date: found 'new': the id already stands in row 2",
        ),
        ([["Day", "Runout s [m]"], ["1999-02-03", "300"]], "b.csv, column Day: what is it?"),
        (
            [["Runout s [m]", "Snow"], ["300", ""]],
            "b.csv, row 1: no column: exactly one names the avalanches",
        ),
    ],
)
def test_contradictions_name_both_tables(
    second: Rows, told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = [wide_file(tmp_path, without_bounds(), "a.csv"), wide_file(tmp_path, second, "b.csv")]
    code, err = imported(capsys, tmp_path, tables)
    assert code == 2 and told in err, err
    assert not (tmp_path / "out").exists()


def test_the_same_reading_in_two_tables_counts_once(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = [wide_file(tmp_path, without_bounds(), "a.csv"), wide_file(tmp_path, RUNOUTS, "b.csv")]
    code, err = imported(capsys, tmp_path, tables)
    assert code == 0, err
    assert same(tmp_path / "out", whole(capsys, tmp_path, without_bounds()))


def test_a_sensor_that_two_tables_place_differently(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = [wide_file(tmp_path, WIDE, "a.csv"), wide_file(tmp_path, SEASON, "b.csv")]
    other = 'tables.b.columns."v upper [m/s]"=front_velocity at=150 unit=m/s sensor=upper'
    code, err = imported(capsys, tmp_path, tables, "--set", other)
    assert code == 2 and "b.csv, row 1, column v upper [m/s]: found '150.0': a.csv, row 1 says '100.0'" in err


def test_what_is_shown_names_the_file_of_each_column(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = [wide_file(tmp_path, SPEEDS, "speeds.csv"), wide_file(tmp_path, RUNOUTS, "runouts.csv")]
    told = [one for one in options() if one != "--quiet"]
    code, out, err = skred(capsys, "import", *tables, "--track", track, *told)
    assert code == 0, err
    assert [line.split()[0] for line in out.splitlines() if "front velocity" in line] == ["speeds.csv"] * 2
    rows = list(csv.reader(io.StringIO(written(RUNOUTS))))
    assert len(rows) == 4 and "runouts.csv" in out


def test_all_sheets_are_those_with_cells(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    book = workbook(tmp_path / "book.xlsx", {"1999": without_bounds(), "Sheet2": [], "Sheet3": []})
    code, err = imported(capsys, tmp_path, [book], "--sheet", "*")
    assert code == 0, err
    assert same(tmp_path / "out", whole(capsys, tmp_path, without_bounds()))
    code, err = imported(capsys, tmp_path, [book], "--sheet", "Sheet2")
    assert code == 2 and "book.xlsx (Sheet2): the sheet is empty" in err
    empty = workbook(tmp_path / "empty.xlsx", {"a": [], "b": []})
    code, err = imported(capsys, tmp_path, [empty], "--sheet", "*")
    assert code == 2 and "empty.xlsx: every sheet is empty" in err


def test_a_cell_is_told_once(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Merged cells leave a blank id, which stands in two tables of the campaign."""
    rows = without_bounds()
    rows[2][0] = ""
    code, err = imported(capsys, tmp_path, [wide_file(tmp_path, rows)])
    assert code == 2 and err.count("row 3, column Date: found ''") == 1 and "1 problem" in err


def test_a_word_that_is_a_sign(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = without_bounds()
    rows[3][1] = ">="
    code, err = imported(capsys, tmp_path, [wide_file(tmp_path, rows)])
    assert code == 2 and '--word ">==missing|not_reached"' in err
    code, err = imported(capsys, tmp_path, [wide_file(tmp_path, rows)], "--word", ">==missing")
    assert code == 0, err
