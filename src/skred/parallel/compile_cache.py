"""Compilation with numba, cached on disk under all the code that may be part of what is compiled.

Numba stamps a cached function with the content of its own file only, so a change in a function it
calls from another file, or in a constant, would go unnoticed and old machine code would run on. Here
the stamp of a room is the content of every file in it, and of the rooms that it calls.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import CacheImpl

# In numba's own order: the user's folder, the source's, the user-wide one.
_NUMBAS_OWN = tuple(CacheImpl._locator_classes[:3])


def stamp_room(folder: Path, *inner: str) -> str:
    """Let what is compiled in the files of a folder be cached under the content of all of them.

    Parameters
    ----------
    folder : Path
    inner : str
        Stamps of the rooms whose compiled functions it calls.

    Returns
    -------
    str
        The stamp, a SHA-256; compiled callers elsewhere are cached under it as well.
    """
    stamp = stamp_of(folder, *inner)
    CacheImpl._locator_classes[:0] = [_stamped(locator, folder, stamp) for locator in _NUMBAS_OWN]
    return stamp


def stamp_of(folder: Path, *inner: str) -> str:
    """SHA-256 over the files of a folder and the stamps of the rooms that it calls."""
    digest = hashlib.sha256("".join(inner).encode())
    for file in sorted(folder.rglob("*.py")):
        digest.update(str(file.relative_to(folder)).encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _stamped(locator: type, folder: Path, stamp: str) -> type:
    """One of numba's cache locators, for the files of a folder and with its stamp."""

    class RoomLocator(locator):
        def get_source_stamp(self) -> str:
            return stamp

        @classmethod
        def from_function(cls, function: Callable[..., Any], file: str) -> Any:
            if folder not in Path(file).resolve().parents:
                return None
            return super().from_function(function, file)

    return RoomLocator


def compiled(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` as it is used here: cached, IEEE division, without the GIL."""
    return njit(*signature, cache=True, error_model="numpy", nogil=True, **options)
