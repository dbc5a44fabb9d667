"""Runouts that avalanches reach once in so many years on average."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.inference.intervals import INTERVAL_PROBABILITY


def runouts_once_in(
    years: Sequence[float], runouts: FloatArray, rate: FloatArray, end_m: float
) -> list[dict[str, Any]]:
    """The runout that is passed once in T years: rate P(runout > s) = 1 / T.

    Parameters
    ----------
    years : sequence of float
        T.
    runouts : (n_populations, n_avalanches) array, m
    rate : (n_populations,) array, 1/year
        Of avalanches like those recorded.
    end_m : float
        End of the track [m]; what comes there runs at least so far.

    Returns
    -------
    list of dict
        ``years``, ``unit``, ``value`` of all populations together, and ``low`` and ``high``, the equal-tailed
        interval over populations and rates. An end is None where avalanches are too rare: there is less than
        one in T years. ``at_least`` says that the value is the end of the track.
    """
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    n_avalanches = runouts.shape[1]
    weights = np.repeat(rate, n_avalanches) / runouts.size
    farthest_first = np.argsort(runouts, axis=None)[::-1]
    ordered, per_year = runouts.ravel()[farthest_first], np.cumsum(weights[farthest_first])
    rows = []
    for time in years:
        each = np.array([_once(row, n) for row, n in zip(runouts, rate * time, strict=True)])
        low, high = (_end(value) for value in np.quantile(each, [tail, 1.0 - tail], method="nearest"))
        # Of all populations together: the runout that is passed with the mean frequency 1 / T.
        value = float(ordered[np.searchsorted(per_year, 1.0 / time)]) if per_year[-1] > 1.0 / time else None
        rows.append(
            {
                "years": float(time),
                "unit": "m",
                "value": value,
                "low": low,
                "high": high,
                "at_least": value is not None and value >= end_m,
            }
        )
    return rows


def _once(runouts: FloatArray, expected: float) -> float:
    """The runout that one of `expected` avalanches passes; minus infinity where fewer than one start."""
    return float(np.quantile(runouts, 1.0 - 1.0 / expected)) if expected > 1.0 else -np.inf


def _end(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
