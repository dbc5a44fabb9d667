"""What other packages offer by entry points: loaded, or refused with one line that names the package."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from skred.errors import InputError

OWN_PACKAGE = "skred"


@dataclass(frozen=True)
class Refused:
    """Something that an installed package offers and that cannot be used.

    Attributes
    ----------
    kind : str
        ``mechanism`` or ``law``.
    id, package : str
        Its name and who offers it.
    reason : str
        In one line.
    """

    kind: str
    id: str
    package: str
    reason: str

    def __str__(self) -> str:
        """One line for a person."""
        return f"the {self.kind} {self.id!r} of the package {self.package} cannot be used: {self.reason}"


class RefusedError(InputError):
    """An entry point that cannot be used."""


def entries_of(group: str) -> list[EntryPoint]:
    """Entry points of a group, by package and name; each once."""
    return list(_entries(group, tuple(map(_folder, sys.path))))


def _folder(path: str) -> tuple[Path, int]:
    """A folder that packages are searched in, and when something was put into it or taken out."""
    folder = Path(path or ".").resolve()
    return folder, folder.stat().st_mtime_ns if folder.exists() else 0


@lru_cache
def _entries(group: str, searched: tuple[tuple[Path, int], ...]) -> list[EntryPoint]:
    """The same while folders are as they were: every look reads all packages, 50 ms."""
    return sorted(set(entry_points(group=group)), key=lambda entry: (package_of(entry), entry.name))


def package_of(entry: EntryPoint) -> str:
    """Name of the distribution that an entry point belongs to."""
    return entry.dist.name if entry.dist is not None else entry.module.partition(".")[0]


def load(entry: EntryPoint) -> Any:
    """What an entry point names.

    Raises
    ------
    RefusedError
        If it cannot be imported, whatever goes wrong in the other package.
    """
    try:
        return entry.load()
    except Exception as error:
        raise RefusedError(f"{entry.value} cannot be loaded ({in_a_line(error)})") from error


def in_a_line(error: BaseException) -> str:
    """Kind and first line of an error."""
    first = next(iter(str(error).strip().splitlines()), "")
    return f"{type(error).__name__}: {first}" if first else type(error).__name__
