"""Numbers of a prediction in sentences."""

from __future__ import annotations

from typing import Any

from skred.chances import digits, percent, period_and_interval


def chance(band: dict[str, float]) -> str:
    """A probability with its interval."""
    return f"{percent(band['value'])} ({percent(band['low'])} to {percent(band['high'])})"


def valued(band: dict[str, float]) -> str:
    """A value with its interval, three significant digits."""
    value, low, high = (digits(band[key], 3) for key in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


def period(band: dict[str, float | None]) -> str:
    """A return period in years with its interval."""
    value, interval = period_and_interval(band["value"], band["low"], band["high"])
    return f"{value} ({interval})" if interval else value


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
