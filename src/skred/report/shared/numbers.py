"""Numbers for people: no more decimals than their error supports, and no difference rounded away."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.chances import digits

ABSENT = "n/a"
"""What stands where a number is not available."""
_MOST_DIGITS = 7
_MOST_ODDS = 50.0


def is_number(value: Any) -> bool:
    """Whether a value of a plain document is a finite number."""
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def floats(values: Sequence[Any] | None) -> NDArray[np.float64]:
    """Values of a plain document as an array, NaN where there is none."""
    return np.array([float(v) if is_number(v) else math.nan for v in values or ()], dtype=float)


def fixed(value: Any, decimals: int = 2, *, signed: bool = False) -> str:
    """Format with a given number of decimals; ``n/a`` where there is no number."""
    if not is_number(value):
        return ABSENT
    text = f"{value:+.{decimals}f}" if signed else f"{value:.{decimals}f}"
    # A difference of -0.001 is no "-0.00".
    return text.lstrip("+-") if float(text) == 0.0 else text


def whole(value: Any) -> str:
    """Format as a whole number."""
    return fixed(value, 0)


def counted(value: Any, thing: str) -> str:
    """How many there are of a thing: 1 avalanche, 2 avalanches."""
    return f"{whole(value)} {thing}{'' if value == 1 else 's'}"


def three_digits(value: Any) -> str:
    """A number to act on, with three significant digits and no exponent; ``n/a`` where there is none."""
    return digits(float(value), 3) if is_number(value) else ABSENT


def share(value: Any) -> str:
    """Format a share between 0 and 1 with two decimals, never rounded to an exact 0 or 1."""
    if not is_number(value):
        return ABSENT
    if 0.0 < value < 0.005:
        return "<0.01"
    if 0.995 <= value < 1.0:
        return ">0.99"
    return f"{value:.2f}"


def odds(nats: Any) -> str:
    """A log Bayes factor as odds, with the nats in brackets: 20 to 1 (3.0 nats)."""
    if not is_number(nats):
        return ABSENT
    size = abs(float(nats))
    ratio = math.exp(size) if size < _MOST_ODDS else math.inf
    shown = f"{ratio:.1f}" if ratio < 9.95 else f"{float(f'{ratio:.1e}'):,.0f}"
    shown = "more than a million" if ratio > 1e6 else shown.replace(",", "\N{NARROW NO-BREAK SPACE}")
    words = f"{shown} to 1" if nats >= 0 else f"1 to {shown}"
    return f"{words} ({fixed(nats, 1)} nats)"


def decimals_for(sd: Any, mcse: Any = None) -> int | None:
    """How many decimals a number with this spread deserves.

    Parameters
    ----------
    sd : float or None
        Its standard deviation: two significant digits of it are shown.
    mcse : float or None
        Its Monte Carlo standard error: no digit beyond the first of it is shown.

    Returns
    -------
    int or None
        Negative: rounded to tens, hundreds, ...; None where neither is known.
    """
    limits = []
    if is_number(sd) and sd > 0:
        limits.append(1 - _magnitude(sd))
    if is_number(mcse) and mcse > 0:
        limits.append(-_magnitude(mcse))
    return min(limits) if limits else None


def rounded(value: Any, decimals: int | None) -> str:
    """Format with the decimals of `decimals_for`; three significant digits where it knows none."""
    if not is_number(value):
        return ABSENT
    if value == 0:
        return "0"
    if decimals is None:
        decimals = 2 - _magnitude(value)
    # Draws that are all alike have an sd of rounding errors: it supports no digits.
    decimals = min(decimals, _MOST_DIGITS - 1 - _magnitude(value))
    if decimals > 7:
        return f"{value:.{max(0, decimals + _magnitude(value))}e}"
    return fixed(round(float(value), decimals), max(0, decimals))


def _magnitude(value: float) -> int:
    return math.floor(math.log10(abs(value)))
