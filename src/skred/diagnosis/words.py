"""Numbers in the sentences of a diagnosis."""

from __future__ import annotations

from skred.units import unit_text


def percent(share: float) -> str:
    """A share or probability in percent, never rounded to none or to certainty."""
    if share > 0.995:
        return "more than 99 %"
    return "less than 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"


def counted(n: int, one: str) -> str:
    """A number and what it counts, in the singular where it is one."""
    return f"{n} {one if n == 1 else one + 's'}"


def plus_minus(mean: float, sd: float, unit: str) -> str:
    """A number with its standard deviation, two significant digits of it, and its unit."""
    spread = f"{sd:#.2g}"
    decimals = len(spread.partition(".")[2])
    text = f"{mean:.3g} ± {sd:.2g}" if "e" in spread else f"{mean:.{decimals}f} ± {sd:.{decimals}f}"
    return f"{text} {unit_text(unit)}".rstrip()


def error_text(value: float, unit: str) -> str:
    """An error of speeds or of runouts: readings are no more precise."""
    return f"{value:.0f}" if unit == "m" else f"{value:.1f}"


TOLD_FROM = 0.05
"""Probability from which what is not the answer is told of: below it, its name misleads more than it
informs."""
MOST_NAMED = 5
"""Sensors or avalanches that a sentence tells of one by one."""
