"""Probabilities and return periods in words, the same in a statement, on a page and in the terminal."""

from __future__ import annotations

import math

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


def period_and_interval(value: float | None, low: float | None, high: float | None) -> tuple[str, str]:
    """A return period in years, two significant digits, and its interval; in words where it has no end."""
    if low is None:
        return ("longer than can be said" if value is None else digits(value, 2)), ""
    if value is None:
        return f"more than {digits(low, 2)}", ""
    return digits(value, 2), f"{digits(low, 2)} {'or more' if high is None else f'to {digits(high, 2)}'}"


def digits(value: float | None, n: int) -> str:
    """A number with n significant digits, and no exponent."""
    if not value:
        return "0"
    places = n - 1 - math.floor(math.log10(abs(value)))
    text = f"{round(value, places):.{max(0, min(places, 4))}f}"
    return text.lstrip("-") if float(text) == 0.0 else text
