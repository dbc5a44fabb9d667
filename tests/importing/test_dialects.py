"""Text tables in every European dialect; what is in doubt is asked about, what is mixed is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from import_cases import (
    COLUMNS,
    WIDE,
    in_dialect,
    options,
    skred,
    wide_file,
    with_decimal,
    without_bounds,
    written,
)
from small_campaign import TEXTS, write_texts

from skred.campaign import read_campaign


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    ("separator", "decimal"), [(";", ","), ("\t", ","), (",", ","), (";", "."), ("|", ",")]
)
def test_the_five_files_need_no_question(
    separator: str,
    decimal: str,
    encoding: str,
    newline: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plain = read_campaign(write_texts(tmp_path / "plain", TEXTS))
    how = {"separator": separator, "decimal": decimal, "encoding": encoding, "newline": newline}
    folder = in_dialect(TEXTS, tmp_path / "other", **how)
    code, out, err = skred(capsys, "import", folder, "--out", tmp_path / "out")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").fingerprint() == plain.fingerprint()
    assert "-3.5" not in err and "decimal" in out


def test_the_embedded_campaign_as_a_european_spreadsheet_saves_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from skred.campaign import find_campaign

    own = find_campaign("ryggfonn")
    texts = {file: (own / file).read_text(encoding="utf-8") for file in TEXTS}
    folder = in_dialect(texts, tmp_path / "de")
    code, _, err = skred(capsys, "import", folder, "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    assert read_campaign(tmp_path / "out").fingerprint() == read_campaign(own).fingerprint()


def test_mixed_decimal_signs_are_refused_with_row_and_column(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [row[:] for row in with_decimal(WIDE, ",")]
    rows[2][1] = "20.1"
    file = wide_file(tmp_path, rows, separator=";")
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2
    assert "table.csv, row 3, column v upper [m/s]: found '20.1': a decimal point here" in err
    assert "table.csv, row 2, column v upper [m/s]: found '30,5': a decimal comma here" in err
    assert not (tmp_path / "out").exists()


def test_declared_decimal_sign_refuses_the_other(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = wide_file(tmp_path)
    arguments = ["import", file, "--track", track, *options(), "--decimal", ",", "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "row 2, column v upper [m/s]: found '30.5'" in err and "table.thousands" in err


def test_what_can_be_thousands_is_asked_about(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [["Date", "Runout s [m]"], ["a", "1,234"], ["b", "2,000"]]
    text = "x_m;z_m\n0;2000\n1000;1000\n4000;0\n"
    track.write_text(text)
    file = wide_file(tmp_path, rows, separator=";")
    arguments = ["import", file, "--track", track, *options("Date=event"), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "'1,234' can be a decimal number or thousands" in err and "--decimal" in err
    code, _, err = skred(capsys, *arguments, "--set", "table.thousands=,")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").values[:, 0].tolist() == [1234.0, 2000.0]


@pytest.mark.parametrize("sign", [".", ","])
def test_the_line_to_copy_does_not_answer_what_is_asked(
    sign: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Elevations as 1.240: pasting what the message shows must not make 1.24 m of them."""
    track.write_text("x_m;z_m\n0;1.240\n60;1.212\n130;1.190\n".replace(".", sign))
    file = wide_file(tmp_path, [["Date", "Runout s [m]"], ["a", "120"]], separator=";")
    arguments = ["import", file, "--track", track, *options("Date=event"), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "--set track.decimal=.|,\n" in err and '[track] decimal = ".|,"' in err
    assert f"if it is thousands, add --set track.thousands={sign} instead" in err
    code, _, err = skred(capsys, *arguments, "--set", f"track.thousands={sign}")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").track.z_m.tolist() == [1240, 1212, 1190]


def test_mixed_signs_name_the_key_of_their_own_table(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    track.write_text("x_m;z_m\n0;1.240,5\n60;1.212\n130;1190,25\n")
    file = wide_file(tmp_path, [["Date", "Runout s [m]"], ["a", "120"]], separator=";")
    arguments = ["import", file, "--track", track, *options("Date=event"), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "declare --set track.thousands=. if it stands" in err, err
    code, _, err = skred(capsys, *arguments, "--set", "track.thousands=.")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").track.z_m.tolist() == [1240.5, 1212, 1190.25]


def test_thousands_with_decimals(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [["Date", "Runout s [m]"], ["a", "1.234,5"]]
    track.write_text("x_m;z_m\n0;2000\n1000;1000\n4000;0\n")
    file = wide_file(tmp_path, rows, separator=";")
    arguments = ["import", file, "--track", track, *options("Date=event"), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "row 2, column Runout s [m]" in err and "table.thousands" in err
    code, _, err = skred(capsys, *arguments, "--set", "table.thousands=.")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").values.tolist() == [[1234.5]]


def test_latin_1_is_asked_about_and_declared(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        [cell.replace("Snow", "Schneehöhe").replace("dry", "für") for cell in row] for row in without_bounds()
    ]
    file = tmp_path / "table.csv"
    file.write_bytes(written(rows).encode("latin-1"))
    arguments = ["import", file, "--track", track, *options(), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "table.csv, row 1: byte 0xf6 is not UTF-8" in err and "Schneehöhe" in err
    assert "--encoding latin-1" in err and '[table] encoding = "latin-1"' in err
    code, _, err = skred(capsys, *arguments, "--encoding", "latin-1")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").events[0].covariates["schneehöhe"] == "für"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "empty"),
        (b"a,b\0\n1,2\n", "NUL"),
        (b"\xd0\xcf\x11\xe0rest", "save it as .xlsx"),
        (b"PK\x03\x04nothing", "not a workbook"),
        (b"Date\n1999\n", "what separates the columns"),
        (b'Date,"v\n', "cannot be read"),
        (b"Date,v [m/s]\n1999,30,5\n", "row 2: the row has 3 cells, the header has 2"),
        (b"Date,v [m/s]\n1999\n", "row 2: the row has 1 cells, the header has 2"),
        (b"Date,v [m/s]\n", "no rows under the header"),
        (b"Date,v,v\n1,2,3\n", "column v: the name also stands in column 2"),
        (b"Date,v [m/s],\n1,2,3\n", "column 3 has cells (row 2) and no name"),
        (b"Date,v,w\n,[m/s],[m/s]\n1,2,3\n", "row 2: the row holds units only"),
        (b"\xff\xfe\x00\xd8", "UTF-16"),
        (b"Date," + b"v" * 300 + b"\n1,2\n", "more than 200 characters"),
        (b"Date,v [m/s]\n1," + b"1" * 100_000 + b"x\n", "not clear"),
        (b"Date,v [m/s]\n1," + b"1" * 200_000 + b"\n", "cannot be read (field larger"),
        (b"Date,v [m/s]\n1,a" + b" " * 100_000 + b"b\n", "not clear"),
    ],
)
def test_what_is_no_table_is_refused(
    content: bytes, told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "table.csv"
    file.write_bytes(content)
    code, _, err = skred(capsys, "import", file, "--track", track, "--out", tmp_path / "out")
    assert code == 2 and told in err and "table.csv" in err
    assert not (tmp_path / "out").exists()


def test_a_title_above_the_table_is_asked_about(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "table.csv"
    for title in ("Table 1\n\n", "Table 1,,,,,\n"):
        file.write_text(title + written(without_bounds()))
        arguments = ["import", file, "--track", track, *options(), "--out", tmp_path / "out", "--force"]
        code, _, err = skred(capsys, *arguments)
        row = 3 if "\n\n" in title else 2
        assert code == 2 and f"--set table.header_row={row}" in err
        code, _, err = skred(capsys, *arguments, "--set", f"table.header_row={row}")
        assert code == 0, err


def test_empty_rows_and_columns_are_skipped(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    spread = [[*row, "", ""] for row in (*rows[:2], [""] * 6, *rows[2:], [""] * 6)]
    for number, content in enumerate((rows, spread)):
        file = wide_file(tmp_path, content, separator=";")
        out = tmp_path / str(number)
        code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", out)
        assert code == 0, err
    texts = [(tmp_path / name / "recordings.csv").read_text() for name in "01"]
    assert texts[0] == texts[1] and len(COLUMNS) == 2


def test_excel_hint_of_the_separator(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "table.csv"
    file.write_text("sep=;\n" + written(with_decimal(without_bounds(), ","), ";"))
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 0, err
    assert read_campaign(tmp_path / "out").values[0, 0] == 30.5


FIVE_CELLS = {
    ">30": "write value 30, status at_least",
    "at least 30,5": "write value 30,5, status at_least",
    "12-18": "write value 12, value_to 18, status between",
    "50 ± 5": "write value 50, sd 5, status observed",
    "unknown": "leave it empty, with the status 'missing'",
    "-": "leave it empty, with the status 'missing'",
    "50 km/h": "'km/h' is no part of a number; write 50 alone",
    "10 %": "'%' is no part of a number; write 10 alone",
    "ca. 30,5": "'ca.' is no part of a number; write 30,5 alone",
    "ca.30": "'ca.' is no part of a number; write 30 alone",
    "1,2,3": "expected one number, such as 12,5",
}


@pytest.mark.parametrize(("cell", "advice"), FIVE_CELLS.items())
def test_what_is_no_number_is_told_so_that_obeying_helps(
    cell: str, advice: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = in_dialect(TEXTS, tmp_path / "other")
    text = (folder / "recordings.csv").read_text(encoding="utf-8-sig")
    (folder / "recordings.csv").write_text(
        text.replace("upper;30;", f"upper;{cell};").replace(";25;", ";25,5;")
    )
    code, _, err = skred(capsys, "import", folder)
    assert code == 2 and "recordings.csv, row 2, column value" in err and advice in err, err
    assert "12.5" not in err and "thousands" not in err


def test_a_word_beside_a_decimal_comma_in_a_wide_table(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = with_decimal(WIDE, ",")
    rows[1][3] = "ca. 320,5"
    file = wide_file(tmp_path, rows, separator=";")
    code, _, err = skred(capsys, "import", file, "--track", track, *options())
    assert code == 2 and "'ca.' is no part of a number; write 320,5 alone" in err and "thousands" not in err


def test_cells_that_are_wrong_alike_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = in_dialect(TEXTS, tmp_path / "other", decimal=",")
    text = (folder / "recordings.csv").read_text(encoding="utf-8-sig")
    for value in ("30", "25", "10", "320", "20", "180"):
        text = text.replace(f";{value};", f";0.{value};", 1)
    (folder / "recordings.csv").write_text(text)
    code, _, err = skred(capsys, "import", folder, "--decimal", ",")
    [line] = [line for line in err.splitlines() if "recordings.csv" in line]
    assert code == 2 and line.endswith(
        "(so in 6 rows: 2, 3 '0.25', 4 '0.10', 5 '0.320', 6 '0.20' and 1 more)"
    )


def test_a_unit_in_the_header_of_the_five_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = read_campaign(write_texts(tmp_path / "plain", TEXTS))
    folder = in_dialect(TEXTS, tmp_path / "other")
    text = (folder / "recordings.csv").read_text(encoding="utf-8-sig").replace("value;", "value [km/h];", 1)
    (folder / "recordings.csv").write_text(text)
    code, _, err = skred(capsys, "import", folder)
    assert code == 2 and "are speeds in km/h" in err and "--set velocity.unit=km/h|m/s" in err
    arguments = ["import", folder, "--set", "velocity.unit=km/h", "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 0, err
    read = read_campaign(tmp_path / "out")
    assert read.values[0].tolist() == pytest.approx([30 / 3.6, 25 / 3.6, 10 / 3.6, plain.values[0, 3]])
    (folder / "recordings.csv").write_text(text.replace("km/h", "m/s", 1))
    code, _, err = skred(capsys, "import", folder, "--out", tmp_path / "same")
    assert code == 0 and read_campaign(tmp_path / "same").fingerprint() == plain.fingerprint(), err


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le"])
def test_a_byte_order_mark_that_stands_twice(
    encoding: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = in_dialect(TEXTS, tmp_path / "other", encoding="utf-8")
    for file in folder.glob("*.csv"):
        file.write_bytes(("\ufeff\ufeff" + file.read_text(encoding="utf-8")).encode(encoding))
    code, out, err = skred(capsys, "import", folder, "--out", tmp_path / "out")
    assert code == 0 and "feff" not in out, err
    [line] = [line for line in out.splitlines() if line.split()[:1] == ["first"]]
    assert line.split()[1:4] == ["0", "30", "25"]


def test_a_file_that_is_not_there_is_told_with_the_nearest_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = in_dialect(TEXTS, tmp_path / "other")
    _, _, err = skred(capsys, "import", folder / "recordngs.csv")
    assert f"is '{folder / 'recordings.csv'}' meant?" in err
    _, _, err = skred(capsys, "import", folder / "zzz")
    assert "there is no such file; correct the path" in err
    _, _, err = skred(capsys, "validate", "rygfonn")
    assert "is 'ryggfonn' meant?" in err
