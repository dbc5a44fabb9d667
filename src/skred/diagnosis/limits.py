"""The limits of a claim."""

from __future__ import annotations

from skred.inference.intervals import LEFT_OUT

LIMIT = 0.01
"""Share of clean campaigns that may be called wrong: the one limit of an alarm."""
NOTHING_AT_MOST = LEFT_OUT
"""Probability of nothing from which on it is in every set that holds as much as a credible one: no claim."""


def fewest_clean(share: float) -> int:
    """Clean campaigns that place a share of them at least: none of them may reach it then."""
    return round(1.0 / share) - 1


FEWEST_CLEAN = fewest_clean(LIMIT)
"""Clean campaigns that place the limit."""
