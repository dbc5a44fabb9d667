"""Compilation of ring 1, cached on disk under the content of the whole ring.

Numba stamps a cached function with the content of its own file only, so a change in a function it
calls from another file would go unnoticed and old machine code would run on. Here the stamp is
the content of every file of the ring.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import CacheImpl

_FOLDER = Path(__file__).resolve().parent


def _fingerprint() -> str:
    digest = hashlib.sha256()
    for file in sorted(_FOLDER.glob("*.py")):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


KERNEL_FINGERPRINT = _fingerprint()
"""SHA-256 over the source of the ring; compiled callers are cached under it as well."""


def _stamped(locator: type) -> type:
    """A numba cache locator for this folder whose source stamp is that of the ring."""

    class RingLocator(locator):
        def get_source_stamp(self) -> str:
            return KERNEL_FINGERPRINT

        @classmethod
        def from_function(cls, function: Callable[..., Any], file: str) -> Any:
            if Path(file).resolve().parent != _FOLDER:
                return None
            return super().from_function(function, file)

    return RingLocator


# In front, in numba's own order (the user's folder, the source's, the user-wide one).
CacheImpl._locator_classes[:0] = [_stamped(base) for base in CacheImpl._locator_classes[:3]]


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` as every function of the ring uses it: cached, IEEE division, without the GIL."""
    return njit(cache=True, error_model="numpy", nogil=True, **options)
