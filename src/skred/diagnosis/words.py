"""Numbers in the sentences of a diagnosis."""

from __future__ import annotations


def percent(share: float) -> str:
    """A share or probability in percent, never rounded to none or to certainty."""
    if share > 0.995:
        return "more than 99 %"
    return "less than 1 %" if share < 0.005 else f"{100.0 * share:.0f} %"
