"""Excel: the same table gives the same campaign; formulas, bombs and damage are refused."""

from __future__ import annotations

import csv
import io
import zipfile
from datetime import datetime
from pathlib import Path

import openpyxl
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
)
from openpyxl.worksheet.formula import ArrayFormula, DataTableFormula
from small_campaign import TEXTS, write_texts

TYPED = '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'
"""A part that declares a type and an entity of its own."""


def test_workbook_and_text_of_one_table_are_one_campaign(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    dated = [rows[0], *([datetime.fromisoformat(row[0]), *row[1:]] for row in rows[1:])]
    files = {
        "english": wide_file(tmp_path, rows),
        "european": wide_file(tmp_path, with_decimal(rows, ","), "european.csv", separator=";"),
        "excel": workbook(tmp_path / "table.xlsx", {"Sheet1": dated}),
        "typed": workbook(tmp_path / "typed.xlsx", {"Sheet1": with_decimal(dated[:1] + rows[1:], ",")}),
    }
    for name, file in files.items():
        code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / name)
        assert code == 0, err
    assert all(same(tmp_path / "english", tmp_path / name) for name in files)


def test_a_workbook_with_the_formats_sheets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sheets = {
        file.removesuffix(".csv"): list(csv.reader(io.StringIO(text)))
        for file, text in TEXTS.items()
        if file.endswith(".csv")
    }
    file = workbook(tmp_path / "book.xlsx", sheets)
    code, _, err = skred(capsys, "import", file, "--reference", "100", "--out", tmp_path / "out")
    assert code == 0, err
    assert same(tmp_path / "out", write_texts(tmp_path / "plain", TEXTS))


def test_which_sheet_is_asked_about(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = workbook(tmp_path / "table.xlsx", {"Notes": [["a"]], "Data 1": without_bounds()})
    arguments = ["import", file, "--track", track, *options(), "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "the sheets Notes, Data 1; which of them?" in err and "--sheet" in err
    code, _, err = skred(capsys, *arguments, "--sheet", "Data 2")
    assert code == 2 and "no sheet named 'Data 2'" in err
    code, _, err = skred(capsys, *arguments, "--sheet", "Data 1")
    assert code == 0, err


def test_merged_header_cells_are_refused(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": without_bounds()})
    book = openpyxl.load_workbook(file)
    book.active.merge_cells("B1:C1")
    book.save(file)
    code, _, err = skred(capsys, "import", file, "--track", track, *DECLARED, "--out", tmp_path / "out")
    assert code == 2 and "table.xlsx, row 1, column number 3: column 3 has cells (row 2) and no name" in err
    assert "Unmerge" in err


def test_a_formula_without_a_result_is_not_a_blank(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    rows[1][1] = "=15+15"
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": rows})
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and "row 2, column number 2: found '=15+15': a formula without a stored result" in err


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        (ArrayFormula("B2:B3", "=B9:B10*2"), "found '=B9:B10*2': a formula without a stored result"),
        (DataTableFormula("B2:B3", r1="A1"), "a formula without a stored result"),
    ],
)
def test_no_kind_of_formula_without_a_result_is_a_blank(
    formula: object, told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": without_bounds()})
    book = openpyxl.load_workbook(file)
    book.active["B2"] = formula
    book.save(file)
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and "row 2, column number 2: " in err and told in err, err
    assert not (tmp_path / "out").exists()


def test_an_error_value_is_no_number(tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = without_bounds()
    rows[1][1] = "#DIV/0!"
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": rows})
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and "row 2, column v upper [m/s]" in err and "#DIV/0!" in err


def repacked(file: Path, change: dict[str, bytes]) -> None:
    """A workbook with some of its parts replaced or added."""
    with zipfile.ZipFile(file) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (parts | change).items():
            archive.writestr(name, content)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"xl/bomb.xml": bytes(210_000_000)}, "unpacks to more than is read"),
        ({f"xl/{number}.xml": b"" for number in range(1001)}, "unpacks to more than is read"),
        ({"xl/workbook.xml": TYPED.encode()}, "declares a document type"),
        ({"xl/workbook.xml": f"<!--{'z' * 200_000}-->{TYPED}".encode()}, "declares a document type"),
        ({"xl/styles.xml": b"<?a" + b" " * 70_000 + b"?>" + TYPED.encode()}, "declares a document type"),
        ({"xl/workbook.xml": TYPED.encode("utf-16")}, "declares a document type"),
        ({"xl/workbook.xml": b"<workbook"}, "not a workbook that can be read"),
        ({"xl/worksheets/sheet1.xml": b"<worksheet><sheetData><row><c>"}, "not a workbook that can be read"),
        ({"[Content_Types].xml": b""}, "not a workbook that can be read"),
    ],
)
def test_hostile_workbooks(
    change: dict[str, bytes], told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": without_bounds()})
    repacked(file, change)
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and told in err, err


def test_words_of_xml_in_cells_declare_nothing(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = without_bounds()
    rows[1][5], rows[2][5] = "<!DOCTYPE html>", "<!ENTITY wet>"
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": rows})
    repacked(file, {"xl/media/drawing.bin": b"\x89<!DOCTYPE", "xl/note.xml": b"<a><![CDATA[<!DOCTYPE]]></a>"})
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 0, err


def test_a_sheet_of_no_end_is_refused(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows: list[list[object]] = [[f"c{number}" for number in range(2500)], ["x"] * 2500]
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": rows})
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 2 and "more rows, columns or cells than are read" in err


def test_bounds_are_kept_in_workbooks(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = workbook(tmp_path / "table.xlsx", {"Sheet1": WIDE})
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "out")
    assert code == 0, err
    assert "2002-02-27,runout,250,at_least" in (tmp_path / "out" / "recordings.csv").read_text()
