"""Shares, medians and means with their number of trials and 95 % intervals.

Where there is no trial there is no number: ``n`` is 0 and the rest is None.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
from scipy.stats import binomtest

from skred.arrays import FloatArray, IntArray

LEVEL = 0.95
SEED = 20_911
"""Of everything drawn for an interval, so that the same answers give the same scorecard."""
RESAMPLES = 1000


def share(hits: Sequence[bool]) -> dict[str, Any]:
    """A share with its interval (Clopper and Pearson, 1934)."""
    n, k = len(hits), int(np.sum(hits, dtype=int))
    if n == 0:
        return {"n": 0, "hits": 0, "share": None, "low": None, "high": None}
    low, high = _clopper_pearson(k, n, "two-sided")
    return {"n": n, "hits": k, "share": k / n, "low": low, "high": high}


def upper_limit(hits: Sequence[bool]) -> float | None:
    """One-sided 95 % upper limit of a share (Clopper and Pearson)."""
    if len(hits) == 0:
        return None
    return _clopper_pearson(int(np.sum(hits, dtype=int)), len(hits), "less")[1]


@cache
def _clopper_pearson(k: int, n: int, side: Literal["two-sided", "less"]) -> tuple[float, float]:
    interval = binomtest(k, n, alternative=side).proportion_ci(LEVEL)
    return float(interval.low), float(interval.high)


def resamples(n: int, n_resamples: int = RESAMPLES) -> IntArray:
    """Indices of trials drawn with replacement, (n_resamples, n)."""
    return np.random.default_rng(SEED).integers(n, size=(n_resamples, n))


def interval_of(values: FloatArray) -> tuple[float, float]:
    """The 95 % interval of resampled values; those that are not finite are left out."""
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return float("nan"), float("nan")
    low, high = np.quantile(values, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return float(low), float(high)


def estimate(
    columns: Sequence[Sequence[float]] | Sequence[FloatArray], statistic: Callable[..., FloatArray]
) -> dict[str, Any]:
    """A statistic of trials with its bootstrap interval.

    Parameters
    ----------
    columns : sequence of (n,) arrays
        Values of the trials, paired.
    statistic : callable
        Columns of shape (..., n) to values of shape (...).

    Returns
    -------
    dict
        ``n``, ``value``, ``low`` and ``high``; the interval is None for fewer than two trials.
    """
    data = [np.asarray(column, dtype=float) for column in columns]
    n = len(data[0])
    if n == 0:
        return {"n": 0, "value": None, "low": None, "high": None}
    value = _number(float(statistic(*data)))
    if n == 1 or value is None:
        return {"n": n, "value": value, "low": None, "high": None}
    index = resamples(n)
    low, high = interval_of(np.asarray(statistic(*(column[index] for column in data))))
    return {"n": n, "value": value, "low": _number(low), "high": _number(high)}


def median(values: Sequence[float]) -> dict[str, Any]:
    """A median with its bootstrap interval."""
    return estimate([values], lambda column: np.median(column, axis=-1))


def mean(values: Sequence[float]) -> dict[str, Any]:
    """A mean with its bootstrap interval."""
    return estimate([values], lambda column: np.mean(column, axis=-1))


def quantile(values: Sequence[float], level: float) -> dict[str, Any]:
    """A quantile with its bootstrap interval."""
    return estimate([values], lambda column: np.quantile(column, level, axis=-1))


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
