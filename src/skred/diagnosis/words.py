"""Numbers in the sentences of a diagnosis, and which priors it took."""

from __future__ import annotations

import math
from collections.abc import Sequence

from skred.inference.influence_words import enumerated
from skred.inference.intervals import ENDS
from skred.physics.law import Law
from skred.physics.mechanisms.stretches import STRETCHES_M
from skred.units import unit_text


def percent(share: float) -> str:
    """A share or probability in percent, never rounded to none or to certainty."""
    if share > 0.995:
        return "more than 99 %"
    return "less than 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"


def prior_note(law: Law) -> str:
    """Which priors are not the law's own, and which of them only its calibration has; empty where all are.

    Besides it all steps go by half-normal priors of the coefficients (`mean_prior`).
    """
    of_coefficients = {mechanism.strength.name for mechanism in law.mechanisms}
    only = [name for name, _ in law.changed_priors if name not in of_coefficients]
    if not only:
        return law.prior_note
    return (
        f"{law.prior_note} What may be missing is looked for under priors of the coefficients, which"
        f" {enumerated(only)} {'does' if len(only) == 1 else 'do'} not change."
    )


def no_room() -> str:
    """That nothing was looked for on a stretch."""
    return (
        "Nothing was looked for on a stretch of the track, no obstacle either: the recorded part is shorter"
        f" than the shortest stretch looked at ({min(STRETCHES_M):.0f} m)."
    )


def counted(n: int, one: str) -> str:
    """A number and what it counts, in the singular where it is one."""
    return f"{n} {one if n == 1 else one + 's'}"


def plus_minus(mean: float, sd: float, unit: str) -> str:
    """A number with its standard deviation, two significant digits of it, and its unit."""
    if not sd > 0.0:
        return f"{mean:.3g} {unit_text(unit)}".rstrip()
    exponent = math.floor(math.log10(max(abs(mean), sd)))
    power = exponent if exponent < 0 and "e" in f"{sd:#.2g}" else 0
    of_mean, of_sd = mean / 10.0**power, sd / 10.0**power
    decimals = max(1 - math.floor(math.log10(float(f"{of_sd:.1e}"))), 0)
    text = f"{of_mean:.{decimals}f} ± {of_sd:.{decimals}f}"
    return f"{text if power == 0 else f'({text})e{power}'} {unit_text(unit)}".rstrip()


def error_texts(values: Sequence[float], unit: str) -> list[str]:
    """Errors of speeds (one decimal) or runouts (none), equally many of each; two digits of small ones."""
    usual = 0 if unit == "m" else 1
    small = (1 - math.floor(math.log10(value)) for value in values if value > 0.0)
    decimals = max([usual, *small])
    return [f"{value:.{decimals}f}" for value in values]


TOLD_FROM = ENDS[0]
"""Probability from which what is not the answer is told of: below what a tail of an interval leaves out, its
name misleads more than it informs."""
MOST_NAMED = 5
"""Sensors or avalanches that a sentence tells of one by one."""
