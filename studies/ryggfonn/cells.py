"""Cells of the tables of docs/ryggfonn.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Found = Mapping[str, Any]


def where_text(location: Found | None) -> str:
    """A stretch [m along the track]; nothing where there is none."""
    return "" if location is None else f"{location['s_from_m']:.0f}-{location['s_to_m']:.0f} m"


def share_text(probability: float) -> str:
    """A probability to a hundredth."""
    return f"{probability:.2f}" if probability >= 0.005 else "<0.01"


def number_text(value: float | None) -> str:
    """Two digits of a number; a dash where there is none."""
    return "-" if value is None else f"{value:.2g}"
