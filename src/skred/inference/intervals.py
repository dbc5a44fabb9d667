"""What is told of numbers: the kind of interval in all tables and files, and which differences count."""

from __future__ import annotations

from typing import Any

import numpy as np

INTERVAL_KIND, INTERVAL_PROBABILITY = "equal-tailed", 0.9
PRACTICAL_DIFFERENCE = 4.0
"""Differences of elpd below this are called no practical difference."""


def interval(values: Any) -> tuple[float, float]:
    """Equal-tailed interval of draws."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(np.ravel(values), [tail, 1.0 - tail])
    return float(low), float(high)
