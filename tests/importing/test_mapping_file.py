"""The mapping file: the next table imports without questions; a stranger's leads nowhere."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from import_cases import WIDE, options, skred, wide_file, with_decimal
from small_campaign import TEXTS, write_texts

from skred.campaign import read_campaign
from skred.importing import Mapping, read_mapping
from skred.importing.mapping_text import mapping_text


def test_the_next_table_imports_without_questions(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = with_decimal([[cell.removeprefix(">= ") for cell in row] for row in WIDE], ",")
    file = wide_file(tmp_path, rows, separator=";")
    code, _, err = skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "first")
    assert code == 0, err
    track.unlink()  # the campaign's own track lies beside the mapping file
    following = [rows[0], ["2003-03-14", "28,5", "-", "200", "", "wet"]]
    file = wide_file(tmp_path, following, "next.csv", separator=";")
    mapping = tmp_path / "first" / "import.toml"
    code, out, err = skred(capsys, "import", file, "--mapping", mapping, "--out", tmp_path / "second")
    assert (code, err) == (0, "")
    assert "taken from its name" not in out
    first, second = read_campaign(tmp_path / "first"), read_campaign(tmp_path / "second")
    assert second.sensors == first.sensors and second.track.s_m.tolist() == first.track.s_m.tolist()
    assert second.values[0].tolist()[::2] == [28.5, 200.0]
    again = (tmp_path / "second" / "import.toml").read_text()
    assert again == mapping.read_text()


def test_the_mapping_of_the_formats_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    events = TEXTS["events.csv"].replace("snow_temperature_degC", "temperature")
    folder = write_texts(tmp_path / "in", {**TEXTS, "events.csv": events})
    code, _, err = skred(capsys, "import", folder, "--out", tmp_path / "first")
    assert code == 2 and err.count("column temperature") == 1 and "what is its unit?" in err
    column = "temperature=covariate name=snow_temperature_degC"
    code, _, err = skred(capsys, "import", folder, "--column", column, "--out", tmp_path / "first")
    assert code == 0, err
    mapping = tmp_path / "first" / "import.toml"
    code, _, err = skred(capsys, "import", folder, "--mapping", mapping, "--out", tmp_path / "second")
    assert (code, err) == (0, "")
    prints = [read_campaign(tmp_path / name).fingerprint() for name in ("first", "second")]
    assert prints[0] == prints[1] == read_campaign(write_texts(tmp_path / "plain", TEXTS)).fingerprint()


def test_two_covariates_of_the_formats_files_do_not_become_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    events = TEXTS["events.csv"].replace("snow_temperature_degC", "temperature")
    folder = write_texts(tmp_path / "in", {**TEXTS, "events.csv": events})
    column = "temperature=covariate name=release_s_m"
    code, _, err = skred(capsys, "import", folder, "--column", column, "--out", tmp_path / "out")
    told = (
        "events.csv, row 1, column temperature: it would be called 'release_s_m', as is column 'release_s_m'"
    )
    assert code == 2 and told in err, err


def test_a_declared_column_that_is_not_there(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = wide_file(tmp_path, WIDE)
    skred(capsys, "import", file, "--track", track, *options(), "--out", tmp_path / "first")
    file = wide_file(tmp_path, [[row[0], *row[2:]] for row in WIDE], "next.csv")
    mapping = tmp_path / "first" / "import.toml"
    code, _, err = skred(capsys, "import", file, "--mapping", mapping, "--out", tmp_path / "second")
    assert code == 2 and "next.csv, row 1, column v upper [m/s]: declared, and not in the table" in err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("format = 2\n", "key format"),
        ("format = 1\n[columns]\na = {is = 'event', at = 3}\n", "has no at"),
        ("format = 1\n[tabel]\n", "key tabel: no such key"),
        ("format = \n", "not a mapping file"),
        ("a." * 3000 + "a = 1\n", "not a mapping file"),
        ("x = " + "[" * 5000 + "]" * 5000, "not a mapping file"),
        ("format = 1\n[track]\nfile = '../outside.csv'\n", "outside the folder"),
        ("format = 1\n[track]\nfile = '/etc/hostname'\n", "outside the folder"),
        ("format = 1\n[table]\nencoding = 'rot13'\n", "key table.encoding"),
        ("format = 1\n[velocity]\nrelative_sd = nan\n", "key velocity.relative_sd"),
    ],
)
def test_bad_mapping_files_are_told(
    text: str, told: str, tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    track.rename(tmp_path / "outside.csv")
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "import.toml").write_text(text)
    arguments = ["import", wide_file(inner), "--mapping", inner / "import.toml", "--out", tmp_path / "out"]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and told in err, err
    assert not (tmp_path / "out").exists()


NAMES = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), min_size=1, max_size=30)
SILENCES = st.sampled_from(["missing", "not_reached"])


@given(
    names=st.lists(NAMES, min_size=1, max_size=4, unique=True),
    words=st.dictionaries(NAMES, SILENCES, max_size=3),
    sd=st.floats(0, 1e6),
    separator=st.sampled_from([";", "\t", ",", '"', "\\"]),
)
def test_every_mapping_is_read_back(
    names: list[str], words: dict[str, str], sd: float, separator: str
) -> None:
    import tempfile

    columns = {name: {"is": "runout", "place": "x", "absolute_sd": sd, "sensor": name} for name in names}
    mapping = Mapping.model_validate(
        {"columns": columns, "cells": {"words": words}, "table": {"separator": separator}}
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "import.toml"
        file.write_text(mapping_text(mapping), encoding="utf-8", newline="")
        assert read_mapping(file) == mapping
