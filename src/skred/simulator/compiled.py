"""Compilation of the simulator; see `skred.parallel.compile_cache`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from skred.parallel.compile_cache import stamp_room

stamp_room(Path(__file__).resolve().parent)


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit`, cached; a division by zero is an error here, as in Python."""
    return njit(cache=True)(function)
