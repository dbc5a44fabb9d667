"""What naming buys: held-out score, gain on fresh avalanches promised and realised; what it costs: time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skred.prove.scoring.answers import Pair
from skred.prove.scoring.intervals import estimate, median, quantile, share
from skred.prove.scoring.standards import CPU_LIMIT_S, LIMIT_S


def held_out(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Whether avalanches left out are predicted better by the augmented law, where one was named."""
    named = [pair for pair in pairs if pair.name]
    differences = [value for pair in named if (value := pair.number("evidence", "elpd_diff")) is not None]
    return {
        "n_named": len(named),
        "n_without_difference": len(named) - len(differences),
        "better_where_named": share([value > 0.0 for value in differences]),
        "difference_nats_median": median(differences),
    }


def gains(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Gain per event promised by held-out avalanches against that realised on fresh ones [nats].

    The ratio of sums weighs trials by what they promise; the slope is that of realised on promised gain
    through the origin.
    """
    both = [(pair.number("gain", "promised"), pair.number("gain", "realised")) for pair in pairs]
    known = [(one, other) for one, other in both if one is not None and other is not None]
    promises = [one for one, _ in known]
    outcomes = [other for _, other in known]
    return {
        "n": len(known),
        "realised_over_promised": estimate(
            [outcomes, promises], lambda r, p: np.sum(r, axis=-1) / np.sum(p, axis=-1)
        ),
        "slope_through_origin": estimate(
            [outcomes, promises], lambda r, p: np.sum(r * p, axis=-1) / np.sum(p * p, axis=-1)
        ),
        "realised_positive": share([one > 0.0 for one in outcomes]),
        "promised_nats_per_event": promises,
        "realised_nats_per_event": outcomes,
    }


def times(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Wall and CPU time of a verdict, and how many kept the limits of their kind."""
    identify = [value for pair in pairs if (value := pair.number("seconds", "identify")) is not None]
    return {
        "wall": _times(pairs, "wall_seconds", LIMIT_S),
        "cpu": _times(pairs, "cpu_seconds", CPU_LIMIT_S),
        "identify_step_quantile_90_seconds": quantile(identify, 0.9),
    }


def _times(pairs: Sequence[Pair], key: str, limits: dict[str, float]) -> dict[str, Any]:
    values = [(pair, value) for pair in pairs if (value := pair.number(key)) is not None]
    seconds = [value for _, value in values]
    kept = [value <= limits.get(pair.kind, np.inf) and not pair.failed for pair, value in values]
    return {
        "median_seconds": median(seconds),
        "quantile_90_seconds": quantile(seconds, 0.9),
        "max_seconds": max(seconds, default=None),
        "within_limit": share(kept),
    }


def failures(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Crashes, time-outs and answers that never came: wrong answers all."""
    return {
        "crash": share([pair.verdict == "crash" for pair in pairs]),
        "timeout": share([pair.verdict == "timeout" for pair in pairs]),
    }
