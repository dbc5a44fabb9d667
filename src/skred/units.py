"""Units as people read them: one way everywhere."""

from __future__ import annotations

import re

_SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_FACTOR = re.compile(r"([A-Za-z]+)(-?)(\d*)")


def unit_text(unit: str) -> str:
    """A unit for people: ``m s-1`` as m/s, ``m2 s-2`` as m²/s², ``m-1`` as 1/m; none for ``1``."""
    if unit == "1":
        return ""
    found = [_FACTOR.fullmatch(part) for part in unit.split()]
    factors = [one.groups() for one in found if one is not None]
    if len(factors) != len(found):
        return unit  # words, or written for people already
    above = [_power(name, digits) for name, sign, digits in factors if not sign]
    below = [_power(name, digits) for name, sign, digits in factors if sign]
    if not below:
        return " ".join(above)
    under = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{under}"


def _power(name: str, digits: str) -> str:
    return name + ("" if digits in ("", "1") else digits.translate(_SUPERSCRIPT))
