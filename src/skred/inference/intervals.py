"""Conventions of all tables and files: the kind of interval, and the least difference that counts."""

from __future__ import annotations

from typing import Any

import numpy as np

INTERVAL_KIND = "equal-tailed"
INTERVAL_PROBABILITY = 0.9
"""Of intervals, bands and credible sets, and of finding a strength at its detection limit."""
PRACTICAL_DIFFERENCE = 4.0
"""Smaller differences of elpd are called no practical difference."""


def interval(values: Any) -> tuple[float, float]:
    """Equal-tailed interval of draws."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(np.ravel(values), [tail, 1.0 - tail])
    return float(low), float(high)
