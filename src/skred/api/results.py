"""What the functions return: a document, draws, and the report that the command would have written."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


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
        Holds the documents as long as the result lives; `report` puts them where they stay.
    """

    command: str
    subject: str
    document: dict[str, Any]
    posterior: xr.DataTree | None
    folder: Path

    def __post_init__(self) -> None:
        """Let the folder go with the result."""
        weakref.finalize(self, shutil.rmtree, self.folder, True)

    @property
    def statement(self) -> list[str]:
        """What came out, in sentences."""
        said = self.document.get("statement", [])
        return [said] if isinstance(said, str) else list(said)

    def tree(self, file: str) -> xr.DataTree:
        """One of the netCDF files, such as ``augmented.nc`` of a diagnosis that added something.

        Raises
        ------
        FileNotFoundError
            If there is none of that name; the message names those that there are.
        """
        import xarray as xr

        there = sorted(str(one.relative_to(self.folder)) for one in self.folder.rglob("*.nc"))
        if file not in there:
            raise FileNotFoundError(f"no {file}; there are: {', '.join(there)}")
        with xr.open_datatree(self.folder / file, engine="h5netcdf") as opened:
            return opened.load()

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
    heads = ("parameter", "unit", "mean", "sd", "5 %", "95 %")
    cells = [
        [row["name"], row["unit"], *(f"{row[key]:.4g}" for key in ("mean", "sd", "low", "high"))]
        for row in rows
    ]
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(one))}</td>' for one in row)}</tr>" for row in cells)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def fresh_folder() -> Path:
    """A folder of its own for a result's documents."""
    return Path(tempfile.mkdtemp(prefix="skred-"))
