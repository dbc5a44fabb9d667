"""A result: what it shows, and the folder that lives as long as it or a copy of it does."""

from __future__ import annotations

import copy
import gc
import pickle
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

import skred
from skred.api.results import Result, fresh_folder
from skred.errors import InputError
from skred.output import OutputError

ROW = {"name": "<b>", "unit": "&", "mean": 1.0, "sd": 1.0, "low": 1.0, "high": 1.0}


def made(rows: list[dict[str, Any]]) -> Result:
    with fresh_folder() as folder:
        return Result("calibrate", "<img>", {"statement": "<script>", "parameters": rows}, None, folder)


def test_names_are_escaped_and_the_folder_goes_with_the_result() -> None:
    result = made([ROW])
    page, folder = result.html(), result.folder
    assert "<script>" not in page and "<img>" not in page and "<b>" not in page and "&lt;b&gt;" in page
    assert repr(result) == "<skred calibrate: <img>>" and folder.is_dir()
    del result
    gc.collect()
    assert not folder.exists()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_keeps_the_folder(copied: Any) -> None:
    result = made([ROW])
    folder, other = result.folder, copied(result)
    del result
    gc.collect()
    assert folder.is_dir() and other.folder == folder
    del other
    gc.collect()
    assert not folder.exists()


def test_a_result_is_not_pickled() -> None:
    with pytest.raises(TypeError, match=r"cannot be pickled.*result\.report"):
        pickle.dumps(made([ROW]))


def test_a_number_that_is_not_there_is_shown_as_such() -> None:
    assert "<td>n/a</td>" in made([ROW | {"mean": None, "sd": 10**400}]).html()


def test_a_tree_is_named_by_a_text_or_a_path() -> None:
    result = made([])
    xr.DataTree().to_netcdf(result.folder / "base.nc", engine="h5netcdf")
    for name in ("base.nc", Path("base.nc")):
        assert not result.tree(name).children
    with pytest.raises(FileNotFoundError, match=r"there are: base\.nc"):
        result.tree("../base.nc")


def test_what_is_refused_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(InputError, match="9999"):
        skred.diagnose(lock=9999)
    assert not list(tmp_path.glob("skred-*"))


def test_a_folder_that_holds_files_is_told_by_the_argument(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with pytest.raises(OutputError, match="choose another path, or force=True"):
        made([]).report(tmp_path)
