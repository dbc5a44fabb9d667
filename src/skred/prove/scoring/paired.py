"""Two methods on the same trials: names at equal false alarms, detection, log score.

Methods are loose or strict, and a loose one finds more. So each method's score, a number that says how
strongly something is missing, gets the threshold at which it raises as many false alarms, on trials where
nothing is hidden, as the diagnosis does with its verdicts. For the diagnosis the score is 1 less the
probability of nothing. The intervals come from drawing trials again, thresholds and all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.prove.scoring.answers import NOTHING, UNLISTED, Pair
from skred.prove.scoring.intervals import SEED, interval_of, mean
from skred.prove.scoring.probability import log_score

_RESAMPLES = 500
_LEAST = float("-inf")
"""Score of an answer that failed or states none."""


@dataclass(frozen=True, eq=False)
class Side:
    """One method's part of a comparison.

    Attributes
    ----------
    null_score, hidden_score, listed_score : arrays
        Scores where nothing, something, something listed is hidden.
    null_alarm : array
        Alarms by the method's own verdicts.
    first, first_of_set : arrays
        Whether the leading name, or one of its set, is right, whatever the score.
    decided, decided_set : arrays
        The same by the method's own verdicts.
    """

    null_score: FloatArray
    hidden_score: FloatArray
    listed_score: FloatArray
    null_alarm: BoolArray
    first: BoolArray
    first_of_set: BoolArray
    decided: BoolArray
    decided_set: BoolArray


def compare(ours: Sequence[Pair], theirs: Sequence[Pair]) -> dict[str, Any]:
    """Compare two methods on the same trials, in the same order.

    Returns
    -------
    dict
        Shares of all trials with listed effects; `difference` is ours less theirs, with a paired bootstrap
        interval. ``as_decided`` takes our verdicts as they are, and the threshold for theirs only.
    """
    one, other = _side(ours), _side(theirs)
    differences = _log_score_differences(ours, theirs)
    return {
        "n_nulls": len(one.null_score),
        "n_listed": len(one.first),
        "n_hidden": len(one.hidden_score),
        "false_alarms": int(one.null_alarm.sum()),
        "right_first_name": _difference(one, other, "first"),
        "right_set": _difference(one, other, "first_of_set"),
        "as_decided_right_first_name": _difference(one, other, "first", decided="decided"),
        "as_decided_right_set": _difference(one, other, "first_of_set", decided="decided_set"),
        "roc_area": {"ours": roc_area(one.hidden_score, one.null_score),
                     "theirs": roc_area(other.hidden_score, other.null_score)},
        "log_score_difference_nats": None if differences is None else mean(differences),
    }  # fmt: skip


def score_of(answer: Mapping[str, Any]) -> float:
    """How strongly an answer says that something is missing; least where it does not say."""
    pair = Pair("", {}, answer)
    if pair.failed:
        return _LEAST
    given = pair.number("score")
    if given is None and NOTHING in pair.probability:
        given = 1.0 - pair.probability[NOTHING]
    return _LEAST if given is None else given


def threshold(null_scores: FloatArray, n_alarms: int) -> float:
    """Score above which at most so many of these lie."""
    if n_alarms >= len(null_scores):
        return _LEAST
    return float(np.sort(null_scores)[::-1][n_alarms])


def roc_area(hidden: FloatArray, nulls: FloatArray) -> float | None:
    """Area under the ROC curve: how often a hidden effect scores above nothing; ties count half."""
    if len(hidden) == 0 or len(nulls) == 0:
        return None
    above = hidden[:, None] > nulls[None, :]
    return float(np.mean(above + 0.5 * (hidden[:, None] == nulls[None, :])))


def _names(pair: Pair) -> list[str]:
    """Names to be compared whatever the verdict: those stated, else the most probable listed id."""
    stated = pair.answer.get("mechanism")
    if stated:
        return [str(stated), *map(str, pair.answer.get("indistinguishable") or ())]
    if pair.verdict == "unexplained":
        return []
    listed = {name: value for name, value in pair.probability.items() if name not in (NOTHING, UNLISTED)}
    return [max(listed, key=lambda name: listed[name])] if listed else []


def _side(pairs: Sequence[Pair]) -> Side:
    nulls = [pair for pair in pairs if pair.is_null]
    listed = [pair for pair in pairs if pair.is_listed]
    names = [_names(pair) for pair in listed]

    def numbers(those: Sequence[Pair]) -> FloatArray:
        return np.array([score_of(pair.answer) for pair in those], dtype=float)

    return Side(
        numbers(nulls),
        numbers([pair for pair in pairs if not pair.is_null]),
        numbers(listed),
        np.array([pair.alarm for pair in nulls], dtype=bool),
        np.array([bool(set(n[:1]) & p.true_ids) for n, p in zip(names, listed, strict=True)], dtype=bool),
        np.array([bool(set(n) & p.true_ids) for n, p in zip(names, listed, strict=True)], dtype=bool),
        np.array([pair.right_name for pair in listed], dtype=bool),
        np.array([pair.right_set for pair in listed], dtype=bool),
    )


def _difference(one: Side, other: Side, hits: str, decided: str = "") -> dict[str, Any]:
    """Shares of right names of both at equal false alarms, and their difference with its interval."""
    n_nulls, n_listed = len(one.null_score), len(one.first)
    if n_nulls == 0 or n_listed == 0:
        return dict.fromkeys(("ours", "theirs", "difference", "low", "high"))

    def shares(nulls: IntArray, listed: IntArray) -> tuple[float, float]:
        alarms = int(one.null_alarm[nulls].sum())
        found = []
        for side in (one, other):
            if decided and side is one:
                found.append(float(getattr(side, decided)[listed].mean()))
                continue
            alarm = side.listed_score[listed] > threshold(side.null_score[nulls], alarms)
            found.append(float((alarm & getattr(side, hits)[listed]).mean()))
        return found[0], found[1]

    ours, theirs = shares(np.arange(n_nulls), np.arange(n_listed))
    rng = np.random.default_rng(SEED)
    drawn = [
        shares(rng.integers(n_nulls, size=n_nulls), rng.integers(n_listed, size=n_listed))
        for _ in range(_RESAMPLES)
    ]
    low, high = interval_of(np.array([a - b for a, b in drawn]))
    return {"ours": ours, "theirs": theirs, "difference": ours - theirs, "low": low, "high": high}


def _log_score_differences(ours: Sequence[Pair], theirs: Sequence[Pair]) -> list[float] | None:
    """Our log score less theirs, trial by trial; None where one of the two states no probabilities at all."""
    if not (any(pair.probability for pair in ours) and any(pair.probability for pair in theirs)):
        return None
    return [log_score(one) - log_score(other) for one, other in zip(ours, theirs, strict=True)]
