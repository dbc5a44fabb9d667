"""Paired differences of elpd between models of the same events, and whether they are practical ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skred.inference.intervals import PRACTICAL_DIFFERENCE

Entry = dict[str, Any]


class PairedDifference(NamedTuple):
    """How much better one model predicts the events than another.

    Attributes
    ----------
    elpd : float
        Sum of the events' differences [nats].
    se, se_doubled : float
        Its standard error, and twice that: with few events it is optimistic.
    practical : bool
        Whether it is at least `PRACTICAL_DIFFERENCE` and more than its doubled standard error.
    """

    elpd: float
    se: float
    se_doubled: float
    practical: bool


def paired_difference(pointwise: ArrayLike, reference: ArrayLike) -> PairedDifference:
    """Compare the elpd of each event under a model with that under a reference."""
    pairs = np.subtract(pointwise, reference)
    elpd, se = float(pairs.sum()), sum_se(pairs)
    practical = bool(abs(elpd) >= PRACTICAL_DIFFERENCE and abs(elpd) > 2.0 * se)
    return PairedDifference(elpd, se, 2.0 * se, practical)


def sum_se(values: ArrayLike) -> float:
    """Standard error of the sum of independent values."""
    return float(np.sqrt(np.size(values) * np.var(np.asarray(values), ddof=1)))


def best_first(entries: Sequence[Entry], elpd: Callable[[Entry], float]) -> tuple[list[Entry], list[Entry]]:
    """Entries that converged, best first, and those that did not."""
    passed = sorted((entry for entry in entries if entry["gate"]["passed"]), key=lambda entry: -elpd(entry))
    return passed, [entry for entry in entries if not entry["gate"]["passed"]]
