"""Where results may go, and that they are never half written."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skred.errors import InputError
from skred.output import output_folder, plain, write_json, write_text


def test_a_new_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = output_folder(tmp_path / "a" / "b", "pcm", force=False)
    assert folder == tmp_path / "a" / "b" and folder.is_dir()


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    assert output_folder(tmp_path, "pcm", force=False) == tmp_path


@pytest.mark.parametrize("name", ["posterior.nc", ".hidden"])
def test_a_folder_with_files_needs_force(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(InputError, match="--force"):
        output_folder(tmp_path, "pcm", force=False)
    assert output_folder(tmp_path, "pcm", force=True) == tmp_path
    assert (tmp_path / name).read_text() == "precious"


@pytest.mark.parametrize("force", [False, True])
def test_a_file_in_the_way_is_never_replaced(tmp_path: Path, force: bool) -> None:
    file = tmp_path / "out"
    file.write_text("precious")
    with pytest.raises(InputError, match="expected a folder"):
        output_folder(file, "pcm", force=force)
    assert file.read_text() == "precious"


def test_without_a_name_every_run_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folders = [output_folder(None, "pcm", force=False) for _ in range(3)]
    assert len(set(folders)) == 3
    for folder in folders:
        assert folder.parent == Path("skred-out") and folder.name.startswith("pcm-") and folder.is_dir()


def test_text_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "summary.json"
    write_text(file, "first")

    def fail(*paths: Any) -> None:
        raise OSError("disk full")

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", fail)
        with pytest.raises(OSError, match="disk full"):
            write_text(file, "second")
    assert file.read_text() == "first"
    write_text(file, "second")
    assert file.read_text() == "second"
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_json_knows_no_nan(tmp_path: Path) -> None:
    document = {
        "nan": float("nan"),
        "infinite": [np.inf, -np.inf, 1.0],
        "array": np.array([[1.5, np.nan]]),
        "numbers": (np.float64(2.5), np.int64(3), np.bool_(True)),
        "none": None,
        7: "seven",
    }
    write_json(tmp_path / "a.json", document)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    assert json.loads((tmp_path / "a.json").read_text(), parse_constant=refuse) == {
        "nan": None,
        "infinite": [None, None, 1.0],
        "array": [[1.5, None]],
        "numbers": [2.5, 3, True],
        "none": None,
        "7": "seven",
    }


def test_what_json_cannot_hold_is_an_error_and_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"a": object()})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [1, 1.5, "a", None, True])
def test_plain_values_stay(value: Any) -> None:
    assert plain(value) is value
