"""Numbers of a prediction in sentences."""

from __future__ import annotations

import math
from typing import Any

_SURE = 0.0005
"""Nearer to 0 or 1 than this a simulated probability is not told: it is no certainty."""


def percent(value: float) -> str:
    """A probability, never as an exact 0 or 100."""
    if value < _SURE:
        return "<0.1 %"
    if value > 1.0 - _SURE:
        return ">99.9 %"
    decimals = 1 if value < 0.0995 or value > 0.9005 else 0
    return f"{100 * value:.{decimals}f} %".replace(".0 %", " %")


def chance(band: dict[str, float]) -> str:
    """A probability with its interval."""
    return f"{percent(band['value'])} ({percent(band['low'])} to {percent(band['high'])})"


def valued(band: dict[str, float]) -> str:
    """A value with its interval, three significant digits."""
    value, low, high = (digits(band[key], 3) for key in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


def period(band: dict[str, float | None]) -> str:
    """A return period in years with its interval, two significant digits; in words where it has no end."""
    value, low, high = (
        None if band[key] is None else digits(band[key], 2) for key in ("value", "low", "high")
    )
    if value is None:
        return "longer than can be said" if low is None else f"more than {low}"
    return f"{value} ({low} {'or more' if high is None else f'to {high}'})"


def digits(value: float | None, n: int) -> str:
    """A number with n significant digits, and no exponent."""
    if not value:
        return "0"
    places = n - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):.{max(0, min(places, 4))}f}"


def ranged(low: float, high: float, unit: str = "") -> str:
    """A range whose values are all as likely; one value where both ends are the same."""
    one = f" {unit}" if unit else ""
    if low == high:
        return f"{low:g}{one}, taken as exact"
    return f"{low:g} to {high:g}{one}, each value as likely"


def name_of(place: dict[str, Any]) -> str:
    """A place by its name and where it is."""
    name = "The reference" if place["name"] == "reference" else str(place["name"])
    return f"{name} (s = {place['s_m']:.0f} m)"
