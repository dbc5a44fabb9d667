"""Chances and return periods in words, on the page and in the terminal."""

from __future__ import annotations

from typing import Any

from skred import chances
from skred.report.shared import document as doc
from skred.report.shared.numbers import ABSENT, is_number, three_digits, whole


def percent(value: Any) -> str:
    """A probability in percent, never as an exact 0 or 100."""
    return chances.percent(value) if is_number(value) else ABSENT


def chance(band: Any) -> str:
    """A probability with its interval."""
    value, low, high = (percent(doc.get(band, key)) for key in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


def banded(band: Any) -> str:
    """A value with its interval."""
    value, low, high = (three_digits(doc.get(band, key)) for key in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


def period(band: Any) -> str:
    """A return period with its interval; one without an end is said in words."""
    value, interval = period_and_interval(band)
    return f"{value} ({interval})" if interval else value


def period_and_interval(band: Any) -> tuple[str, str]:
    """A return period, and its interval: empty where there is none."""
    found = (doc.get(band, key) for key in ("value", "low", "high"))
    return chances.period_and_interval(*(one if is_number(one) else None for one in found))


def once(row: Any) -> str:
    """The runout for a return period with its interval; in words where no avalanche starts in that time."""
    value, low, high = (doc.get(row, key) for key in ("value", "low", "high"))
    if not is_number(value):
        told = "fewer than one avalanche starts in that time"
        return f"{told} (at most s = {whole(high)} m)" if is_number(high) else told
    bound = "at least " if doc.get(row, "at_least") else ""
    return f"{bound}{whole(value)} ({whole(low) if is_number(low) else 'no avalanche'} to {whole(high)})"


def ranged(limits: Any, unit: str) -> str:
    """A range whose values are all as likely; one value where both ends are the same."""
    low, high = limits
    one = f" {unit}" if unit else ""
    if low == high:
        return f"{low:g}{one} (one value, taken as exact)"
    return f"{low:g} to {high:g}{one} (each value as likely)"
