"""What would change a ranking of laws: from the scores of each avalanche, without sampling again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.inference.intervals import PRACTICAL_DIFFERENCE
from skred.inference.paired import paired_difference

_NONE = 1e-9
"""A difference of elpd that is none [nats]."""
_SCHEMES = {"exact": "elpd", "loo": "elpd", "waic": "elpd", "evidence": "mean"}
"""Scores by which laws can be put in an order, and the key of each."""


def ranking(models: Sequence[dict[str, Any]], events: Sequence[str]) -> dict[str, Any] | None:
    """How far the order of laws depends on single avalanches, on scatter, and on the score.

    Parameters
    ----------
    models : sequence of dict
        Entries of laws whose chains converged, best first, see `skred.model_selection.compare.rank`.
    events : sequence of str
        Ids of the avalanches, in the order of the pointwise scores.

    Returns
    -------
    dict or None
        ``best``: id of the first law. ``rivals``: see `rival`, one for each other law. ``orders``: ids of the
        laws from best to worst by each score: ``exact`` (leave-one-event-out, which decides), ``loo``
        (importance sampling alone), ``waic`` and ``evidence``. None with fewer than two laws.
    """
    if len(models) < 2:
        return None
    best = models[0]
    return {
        "best": best["id"],
        "rivals": [
            {
                "id": model["id"],
                **rival(best["exact"]["pointwise"], model["exact"]["pointwise"], events),
                "evidence_difference": model["evidence"]["mean"] - best["evidence"]["mean"],
            }
            for model in models[1:]
        ],
        "orders": {name: _order(models, name, key) for name, key in _SCHEMES.items()},
    }


def _order(models: Sequence[dict[str, Any]], name: str, key: str) -> list[str]:
    return [model["id"] for model in sorted(models, key=lambda one: -one[name][key])]


def rival(best: Sequence[float], other: Sequence[float], events: Sequence[str]) -> dict[str, Any]:
    """What would put another law before the best one, or make their difference count or not.

    Parameters
    ----------
    best, other : (n_events,) sequences, nat
        Log predictive density of each avalanche, left out.
    events : sequence of n_events str

    Returns
    -------
    dict
        ``difference`` and ``se``: of the sums, other less best. ``ratio``: size of the difference over its
        standard error; null where that is 0. ``without_each``: the difference without each avalanche.
        ``reversed_without``: the smallest set of avalanches without which the other law is ahead of the best;
        null where there is none.
        ``counts``: whether the difference counts in practice. ``counts_not_without``: the avalanches that
        favour the best law most, as many as must go until the difference no longer counts; null where it
        does not count anyway. ``events_needed``: how many avalanches like these it takes until it counts, at
        the same difference and scatter for each; null where it counts, or where there is no difference.
    """
    lead = np.subtract(best, other)
    found = paired_difference(other, best)
    strongest = np.argsort(-lead, kind="stable")
    return {
        "difference": found.elpd,
        "se": found.se,
        "ratio": abs(found.elpd) / found.se if found.se > 0 else None,
        "counts": found.practical,
        "without_each": [
            {"event": event, "difference": found.elpd + float(one)}
            for event, one in zip(events, lead, strict=True)
        ],
        "reversed_without": _reversed_without(lead, strongest, events),
        "counts_not_without": _counts_not_without(lead, strongest, events) if found.practical else None,
        "events_needed": None if found.practical else _events_needed(found.elpd, found.se, len(lead)),
    }


def _reversed_without(lead: FloatArray, strongest: IntArray, events: Sequence[str]) -> list[str] | None:
    """The smallest set whose removal turns the sign: the largest terms, as few as do."""
    left = lead.sum() - np.cumsum(lead[strongest])
    turned = np.flatnonzero(left[:-1] < -_NONE)  # one avalanche at least is left
    return [events[k] for k in strongest[: turned[0] + 1]] if len(turned) else None


def _counts_not_without(lead: FloatArray, strongest: IntArray, events: Sequence[str]) -> list[str] | None:
    for n in range(1, len(lead) - 1):
        kept = np.delete(lead, strongest[:n])
        if kept.sum() <= 0.0 or not paired_difference(kept, np.zeros_like(kept)).practical:
            return [events[k] for k in strongest[:n]]
    return None


def _events_needed(difference: float, se: float, n: int) -> int | None:
    """The difference grows with the number of avalanches, its standard error with the root of it."""
    if difference == 0.0:
        return None
    size = abs(difference)
    return max(n + 1, math.ceil(n * max((2.0 * se / size) ** 2, PRACTICAL_DIFFERENCE / size)))
