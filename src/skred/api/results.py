"""What the functions return: a document, draws, and the report that the command would have written."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.api.arguments import told_by_name

if TYPE_CHECKING:
    import xarray as xr


class _Hold:
    """Keeps a temporary folder: copies of a result share it, and with the last of them the folder goes."""

    def __init__(self, folder: Path) -> None:
        weakref.finalize(self, shutil.rmtree, folder, True)

    def __copy__(self) -> _Hold:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> _Hold:
        return self

    def __reduce__(self) -> str:
        raise TypeError(
            "a result cannot be pickled: its documents are in a temporary folder of this process;"
            " write them with result.report(folder)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """What came out, and the documents that its report is made from.

    Attributes
    ----------
    command : str
        Of the command line, which does the same.
    subject : str
        What was asked about, in plain words.
    document : dict
        What the command writes as JSON, with units.
    posterior : DataTree or None
        Draws in ArviZ's groups. Of a comparison one child for each law, of a diagnosis those of the base law;
        None where nothing was sampled.
    folder : Path
        Holds the documents as long as the result or a copy of it lives; `report` puts them where they stay.
    """

    command: str
    subject: str
    document: dict[str, Any]
    posterior: xr.DataTree | None
    folder: Path
    _hold: _Hold = field(init=False)

    def __post_init__(self) -> None:
        """Let the folder go with the last copy of the result."""
        object.__setattr__(self, "_hold", _Hold(self.folder))

    @property
    def statement(self) -> list[str]:
        """What came out, in sentences."""
        said = self.document.get("statement", [])
        return [said] if isinstance(said, str) else list(said)

    def tree(self, file: str | Path) -> xr.DataTree:
        """One of the netCDF files, such as ``augmented.nc`` of a diagnosis that added something.

        Raises
        ------
        FileNotFoundError
            If there is none of that name; the message names those that there are.
        """
        import xarray as xr

        there = sorted(one.relative_to(self.folder).as_posix() for one in self.folder.rglob("*.nc"))
        if Path(file).as_posix() not in there:
            raise FileNotFoundError(f"no {file}; there are: {', '.join(there)}")
        with xr.open_datatree(self.folder / file, engine="h5netcdf") as opened:
            return opened.load()

    @told_by_name
    def report(self, path: str | Path | None = None, *, force: bool = False) -> Path:
        """Write the documents, the figures and the report, as the command does.

        Parameters
        ----------
        path : str or Path, optional
            A folder that is new or empty; by default a new one under ``./skred-out``.
        force : bool
            Take a folder that holds files.

        Returns
        -------
        Path
            The report, or the folder where the command writes no page.

        Raises
        ------
        skred.output.OutputError
            If the folder cannot be used.
        """
        from skred.output import results_folder
        from skred.report.folders import write_reports

        where = None if path is None else Path(path)
        with results_folder(where, self.command, force=force) as results:
            shutil.copytree(self.folder, results.unfinished, dirs_exist_ok=True)
            if self.command != "identify":  # whose document is all of it
                write_reports(results.unfinished)
        page = results.path / "report.html"
        return page if page.is_file() else results.path

    def __repr__(self) -> str:
        """One line."""
        return f"<skred {self.command}: {self.subject}>"

    def _repr_html_(self) -> str:
        """For notebooks."""
        return self.html()

    def html(self) -> str:
        """What was asked and what came out, as a piece of HTML with all names escaped."""
        said = "".join(f"<p>{escape(sentence)}</p>" for sentence in self.statement)
        table = parameter_table(self.document.get("parameters", ()))
        return f"<div><h3>{escape(self.command)}: {escape(self.subject)}</h3>{said}{table}</div>"


def parameter_table(rows: Sequence[dict[str, Any]]) -> str:
    """Parameters of a calibration as an HTML table; nothing where there are none."""
    if not rows:
        return ""
    from skred.report.shared.numbers import ABSENT, is_number

    heads = ("parameter", "unit", "mean", "sd", "5 %", "95 %")
    cells = [
        [
            row["name"],
            row["unit"],
            *(f"{row[key]:.4g}" if is_number(row[key]) else ABSENT for key in ("mean", "sd", "low", "high")),
        ]
        for row in rows
    ]
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(one))}</td>' for one in row)}</tr>" for row in cells)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


@contextmanager
def fresh_folder() -> Iterator[Path]:
    """A folder of its own for a result's documents; gone again where there is no result."""
    folder = Path(tempfile.mkdtemp(prefix="skred-"))
    try:
        yield folder
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
