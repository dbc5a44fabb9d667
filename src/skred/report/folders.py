"""Reports and figures of a folder of results, made from the documents in it: whichever command wrote them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from skred.errors import InputError
from skred.output import write_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

FORMAT = 1
"""Of the documents that this version reads."""
_AGAIN = "run the command that wrote it again"


class ReportError(InputError):
    """A folder without results, or with results that this version cannot read."""


def write_reports(folder: Path) -> list[Path]:
    """Make the report and the figures of a folder of results anew, from its documents alone.

    Nothing in the folder changes before all of it is there; then each file is replaced as a whole, and
    figures that no longer apply are removed.

    Parameters
    ----------
    folder : Path
        Of ``skred diagnose``, ``compare``, ``predict`` or ``prove``, or of a law that was calibrated.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ReportError
        If it holds no results, or results of another version of the format.
    """
    if not folder.is_dir():
        raise ReportError(f"{folder}: no such folder")
    for document, make in _KINDS.items():
        if (folder / document).is_file():
            return _in_place(folder, make)
    names = ", ".join(_KINDS)
    raise ReportError(f"{folder}: no results to report on; a folder of results holds one of {names}")


def _in_place(folder: Path, make: Callable[[Path, Path], list[str]]) -> list[Path]:
    """Write into a hidden folder beside the results, then move everything to where it belongs."""
    with TemporaryDirectory(prefix=".skred-report-", dir=folder) as beside:
        possible = make(folder, Path(beside))
        made = sorted(file.relative_to(beside) for file in Path(beside).rglob("*") if file.is_file())
        for name in made:
            os.replace(Path(beside) / name, folder / name)
    for name in possible:
        if Path(name) not in made:
            (folder / name).unlink(missing_ok=True)
    return [folder / name for name in made]


def _diagnosis(folder: Path, beside: Path) -> list[str]:
    from skred.report.diagnosis.report import FIGURES, render_diagnosis, save_diagnosis_figures

    document = _read_document(folder / "verdict.json", "format")
    _check_format(folder / "verdict.json", document.get("report"), "report.format")
    with _opened(folder / "diagnosis.nc") as tree:
        figures = save_diagnosis_figures(document, tree, beside)
        write_text(beside / "report.html", render_diagnosis(document, tree, figures))
    return [f"{name}.png" for name in FIGURES]


_KINDS: dict[str, Callable[[Path, Path], list[str]]] = {"verdict.json": _diagnosis}
"""What a folder holds, and what makes its report; returns the figures that there may be."""


def _read_document(file: Path, key: str) -> dict[str, Any]:
    """A JSON document of the format that this version reads."""
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ReportError(f"{file}: not a JSON document ({error})") from error
    _check_format(file, document, key)
    return dict(document)


def _check_format(file: Path, document: Any, key: str) -> None:
    """Refuse what was written by another version of the format."""
    found = document.get("format") if isinstance(document, Mapping) else None
    if found != FORMAT:
        told = f"with {key} {found!r} instead of {FORMAT}" if found is not None else f"without {key!r}"
        raise ReportError(f"{file}: written by another version of skred, {told}; {_AGAIN}")


@contextmanager
def _opened(file: Path) -> Iterator[xr.DataTree]:
    """A netCDF file of results, read as far as it is needed."""
    import xarray as xr

    if not file.is_file():
        raise ReportError(f"{file}: not there; {_AGAIN}")
    try:
        opened = xr.open_datatree(file, engine="h5netcdf")
    except (OSError, ValueError) as error:
        raise ReportError(f"{file}: not a netCDF file that can be read ({error})") from error
    with opened as tree:
        _check_format(file, tree.attrs, "format")
        yield tree
