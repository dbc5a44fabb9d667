"""Documents of others: what is no number of a format is told by its file, and nothing else is printed."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

from skred.documents import FORMAT, TREE_FORMAT, opened_tree, read_document
from skred.errors import InputError


@pytest.mark.parametrize(
    "found", [np.array([TREE_FORMAT, TREE_FORMAT]), np.array([0.5, 3.0]), ["a", "b"], 2.5, "3"]
)
def test_a_format_of_a_netcdf_file_that_is_no_number_is_refused(found: Any, tmp_path: Path) -> None:
    file = tmp_path / "posterior.nc"
    xr.DataTree(xr.Dataset(attrs={"format": found})).to_netcdf(file, engine="h5netcdf")
    with pytest.raises(InputError, match=r"posterior\.nc: written by another version of skred, with format"):
        with opened_tree(file):
            pass


def test_the_format_that_is_written_is_read(tmp_path: Path) -> None:
    file = tmp_path / "posterior.nc"
    xr.DataTree(xr.Dataset(attrs={"format": TREE_FORMAT})).to_netcdf(file, engine="h5netcdf")
    with opened_tree(file) as tree:
        assert tree.attrs["format"] == TREE_FORMAT


def test_a_small_file_that_holds_more_than_fits_into_memory_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "posterior.nc"
    with h5py.File(file, "w") as opened:
        opened.attrs["format"] = TREE_FORMAT
        opened.create_dataset("big", (2_000_000_000,), "f8", chunks=(1024,))
    assert file.stat().st_size < 100_000
    with pytest.raises(InputError, match=r"posterior\.nc: holds more than 4 GB"):
        with opened_tree(file):
            pass


@pytest.mark.parametrize("found", [[FORMAT], {"format": FORMAT}, "1", [[FORMAT, FORMAT]]])
def test_a_format_of_a_json_document_that_is_no_number_is_refused(found: Any, tmp_path: Path) -> None:
    file = tmp_path / "summary.json"
    file.write_text(json.dumps({"format": found}))
    with pytest.raises(InputError, match=r"summary\.json: written by another version of skred, with format"):
        read_document(file)


def test_hdf5_that_is_no_netcdf_is_told_once(tmp_path: Path) -> None:
    """Its dimensions have no names; that is no warning, the error says enough."""
    file = tmp_path / "posterior.nc"
    with h5py.File(file, "w") as other:
        other["numbers"] = np.arange(3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="another version of skred, without 'format'"):
            with opened_tree(file):
                pass
