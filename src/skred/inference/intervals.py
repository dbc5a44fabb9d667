"""Conventions of all tables and files: the kind of interval, and the least difference that counts."""

from __future__ import annotations

from typing import Any

import numpy as np

INTERVAL_KIND = "equal-tailed"
INTERVAL_PROBABILITY = 0.9
"""Of intervals, bands and credible sets, and of finding a strength at its detection limit."""
LEFT_OUT = round(1.0 - INTERVAL_PROBABILITY, 9)
"""What a credible set leaves out at most."""
ENDS = (0.5 * LEFT_OUT, 1.0 - 0.5 * LEFT_OUT)
"""Quantiles at which an equal-tailed interval ends."""
PRACTICAL_DIFFERENCE = 4.0
"""Smaller differences of elpd are called no practical difference."""


def interval(values: Any) -> tuple[float, float]:
    """Equal-tailed interval of draws."""
    low, high = np.quantile(np.ravel(values), ENDS)
    return float(low), float(high)
