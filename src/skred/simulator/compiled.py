"""Compilation of the simulator; see `skred.parallel.compile_cache`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skred.parallel import compile_cache


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit`, cached; a division by zero is an error here, as in Python."""
    return compile_cache.compiled(error_model="python", nogil=False)(function)
