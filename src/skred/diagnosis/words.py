"""Numbers in the sentences of a diagnosis."""

from __future__ import annotations

import math

from skred.units import unit_text


def percent(share: float) -> str:
    """A share or probability in percent, never rounded to none or to certainty."""
    if share > 0.995:
        return "more than 99 %"
    return "less than 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"


def counted(n: int, one: str, many: str = "") -> str:
    """A number and what it counts, in the singular where it is one."""
    return f"{n} {one if n == 1 else many or one + 's'}"


def plus_minus(mean: float, sd: float, unit: str) -> str:
    """A number with its standard deviation, two significant digits of it, and its unit."""
    shown = unit_text(unit)
    decimals = 1 - math.floor(math.log10(sd)) if sd > 0.0 else 3
    if 0 <= decimals <= _MOST_DECIMALS:
        text = f"{mean:.{decimals}f} ± {sd:.{decimals}f}"
    else:
        text = f"{mean:.3g} ± {sd:.2g}"
    return f"{text} {shown}".rstrip()


_MOST_DECIMALS = 4
"""Decimals beyond which a number reads better with an exponent."""
