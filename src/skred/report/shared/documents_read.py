"""The documents that a report is made from: all inside one folder, and known again if they are unchanged.

Result folders come from strangers. What is wrong with one shows wherever its numbers are used, as an error of
any kind; a fault of skred shows in the same way. They are told apart by what a page says of its documents:
where these are as they were when skred made the page, the fault is its own.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.documents import AGAIN, opened_tree, read_document
from skred.errors import InputError
from skred.output import UNFINISHED
from skred.report.shared.numbers import is_number

if TYPE_CHECKING:
    import xarray as xr

_SIGNED = re.compile(r"<!-- made from documents of sha256 ([0-9a-f ]+) -->\s*\Z")


class ReportError(InputError):
    """A folder without results, or with results that this version cannot read."""


class Documents:
    """What a report reads of a folder of results.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._read: list[Path] = []
        self._in_use: list[str] = []

    def json(self, name: str) -> dict[str, Any]:
        """A JSON document.

        Raises
        ------
        ReportError
            If it cannot be read, is of another format, or holds what is no number.
        """
        document = read_document(self._inside(name), ReportError)
        self._in_use.append(name)
        for where, value in _numbers(document):
            if not is_number(value):
                raise ReportError(f"{self.folder / name}: {where:.80} is no finite number; {AGAIN}")
        return document

    @contextmanager
    def tree(self, name: str) -> Iterator[xr.DataTree]:
        """A netCDF file, read as far as it is needed.

        Raises
        ------
        ReportError
            If it cannot be read, or is of another format.
        """
        with opened_tree(self._inside(name), ReportError) as tree:
            self._in_use.append(name)
            yield tree
            self._in_use.remove(name)  # not where its use failed

    def _inside(self, name: str) -> Path:
        """A file of the folder; refused where a link in between leads somewhere else."""
        file = self.folder / name
        if file.parent.resolve() != self.folder.resolve() / Path(name).parent:
            raise ReportError(
                f"{file.parent}: a link, not a folder of results; put the folder itself there, or {AGAIN}"
            )
        self._read.append(file)
        return file

    def sign(self, page: Path) -> None:
        """Let a page say which documents it was made from."""
        with page.open("a", encoding="utf-8", newline="\n") as stream:
            stream.write(f"\n<!-- made from documents of sha256 {' '.join(sorted(self._sums()))} -->\n")

    def are_known(self) -> bool:
        """Whether skred wrote what was read: just now, or before it made a page of the same documents."""
        if self.folder.name == UNFINISHED:
            return True
        found = [_SIGNED.search(page.read_text("utf-8", "replace")) for page in self.folder.glob("*.html")]
        return any(one is not None and self._sums() <= set(one[1].split()) for one in found)

    def _sums(self) -> set[str]:
        return {hashlib.sha256(file.read_bytes()).hexdigest() for file in self._read}

    def unusable(self, cause: Exception) -> ReportError:
        """What to tell where documents that skred does not know cannot be used."""
        files = " with ".join(str(self.folder / name) for name in self._in_use) or str(self.folder)
        why = " ".join(f"{type(cause).__name__}: {cause}".split())
        return ReportError(
            f"{files}: not as skred writes it ({why:.100}); {AGAIN}."
            " If nobody has changed it, that is a fault of skred"
        )


def _numbers(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    """All numbers of a document, with their keys."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(item, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from _numbers(item, f"{where}[{k}]")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield where, value
