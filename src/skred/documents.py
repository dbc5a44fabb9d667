"""Documents that skred wrote, read again: JSON and netCDF of the format that this version reads.

Result folders come from strangers: nothing in them is code, and what cannot be read is told by its file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

FORMAT = 1
"""Of JSON documents."""
TREE_FORMAT = 3
"""Of netCDF files."""
MOST_BYTES = 100_000_000
MOST_VARIABLES, LARGEST_TREE = 20_000, 4_000_000_000
"""Of netCDF files, the latter in bytes."""
AGAIN = "run the command that wrote it again"


def read_document(file: Path, error: type[InputError] = InputError) -> dict[str, Any]:
    """A JSON document of the format that this version reads.

    Parameters
    ----------
    file : Path
    error : type of InputError
        What is raised.

    Raises
    ------
    InputError
        If it is not there, not JSON, or of another format.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise error(f"{file}: larger than {MOST_BYTES / 1e6:g} MB; no document of skred")
        content = json.loads(file.read_text(encoding="utf-8"))
    except error:
        raise
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as cause:
        raise error(f"{file}: not a JSON document ({cause})") from cause
    check_format(file, content, "format", FORMAT, error)
    return dict(content)


def check_format(
    file: Path, content: Any, key: str, expected: int, error: type[InputError] = InputError
) -> None:
    """Refuse what was written by another version of the format.

    Parameters
    ----------
    file : Path
    content : mapping
        Holds the number under ``format``; anything else is refused.
    key : str
        As it is told, such as ``report.format``.
    expected : int
    error : type of InputError
    """
    found = content.get("format") if isinstance(content, Mapping) else None
    if not (isinstance(found, Integral) and found == expected):
        told = f"without {key!r}" if found is None else f"with {key} {found!r:.20} instead of {expected}"
        raise error(f"{file}: written by another version of skred, {told}; {AGAIN}")


@contextmanager
def opened_tree(file: Path, error: type[InputError] = InputError) -> Iterator[xr.DataTree]:
    """A netCDF file of results, read as far as it is needed.

    Variables of objects, which would need pickle, are not netCDF and are refused.

    Parameters
    ----------
    file : Path
    error : type of InputError
        What is raised.

    Raises
    ------
    InputError
        If it is not there, not netCDF, or of another format.
    """
    import xarray as xr

    if not file.is_file():
        raise error(f"{file}: not there; {AGAIN}")
    try:
        # HDF5 that is no netCDF may have dimensions without names: they are given some, without a warning
        opened = xr.open_datatree(file, engine="h5netcdf", phony_dims="access")
    except (OSError, ValueError) as cause:
        raise error(f"{file}: not a netCDF file that can be read ({cause})") from cause
    with opened as tree:
        check_format(file, tree.attrs, "format", TREE_FORMAT, error)
        check_size(file, tree, error)
        yield tree


def check_size(file: Path, tree: xr.DataTree, error: type[InputError] = InputError) -> None:
    """Refuse what would not fit into memory, before it is read: a small file may unpack to any size."""
    nodes = list(tree.subtree)
    if sum(len(node.variables) for node in nodes) > MOST_VARIABLES:
        raise error(f"{file}: more than {MOST_VARIABLES} variables; write fewer of them")
    if sum(int(v.nbytes) for node in nodes for v in node.variables.values()) > LARGEST_TREE:
        raise error(f"{file}: holds more than {LARGEST_TREE // 10**9} GB; thin its draws")
