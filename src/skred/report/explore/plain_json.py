"""JSON of files, read so that every number in it can be computed with."""

from __future__ import annotations

import json
import math
from typing import Any

_LONGEST_WHOLE = 300
"""Digits of a whole number that a float still holds."""


def plain_json(text: str | bytes) -> Any:
    """Read JSON; a whole number beyond all floats is infinite, and so no number that is shown.

    Raises
    ------
    ValueError
        If it is not JSON.
    """
    return json.loads(text, parse_int=_whole)


def _whole(digits: str) -> int | float:
    if len(digits) <= _LONGEST_WHOLE:
        return int(digits)
    return -math.inf if digits.startswith("-") else math.inf
