"""All scores of some answers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skred.prove.scoring.alarms import detection, false_alarms
from skred.prove.scoring.answers import Pair
from skred.prove.scoring.confusion import confusion
from skred.prove.scoring.gain import failures, gains, held_out, times
from skred.prove.scoring.naming import naming, selectivity, unlisted
from skred.prove.scoring.places import places, strengths
from skred.prove.scoring.probability import probabilities

KINDS = ("all", "sparse", "dense")


def scores(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Every score of these answers, each with its number of trials and its 95 % interval."""
    return {
        "n": len(pairs),
        "false_alarms": false_alarms(pairs),
        "detection": detection(pairs),
        "naming": naming(pairs),
        "honesty": selectivity(pairs),
        "unlisted": unlisted(pairs),
        "place": places(pairs),
        "strength": strengths(pairs),
        "probability": probabilities(pairs),
        "held_out": held_out(pairs),
        "gain": gains(pairs),
        "time": times(pairs),
        "failures": failures(pairs),
        "confusion": confusion(pairs),
    }


def of_kind(pairs: Sequence[Pair], kind: str) -> list[Pair]:
    """Sparse or dense trials; all."""
    return [pair for pair in pairs if kind in ("all", pair.kind)]


def scores_by_kind(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Scores of open and of masked trials, each for all, sparse and dense ones.

    Masked trials, in which the calibrated base model is right on average at every sensor, are never mixed
    with the others.
    """
    parts = {
        "open": [pair for pair in pairs if not pair.truth.get("masked")],
        "masked": [pair for pair in pairs if pair.truth.get("masked")],
    }
    return {part: {kind: scores(of_kind(those, kind)) for kind in KINDS} for part, those in parts.items()}
