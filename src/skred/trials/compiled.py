"""Compilation of the simulator; see `skred.compiled`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from skred.compiled import stamp_room

stamp_room(Path(__file__).resolve().parent)


def compiled(function: Callable[..., Any]) -> Any:
    """`numba.njit`, cached; a division by zero is an error here, as in Python."""
    return njit(cache=True)(function)
