"""Names: right or wrong, how sure, and what becomes of effects that no list has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skred.prove.scoring.answers import Pair, middle, within
from skred.prove.scoring.intervals import estimate, median, share
from skred.prove.scoring.standards import (
    AROUND_7,
    AROUND_10,
    CEILING_SNR,
    NAMED_CEILING,
    NEAR_M,
    RIGHT_NAME_CEILING,
    SNR_BINS,
    Ceilings,
    ceiling,
)

LARGEST_SET = 3
HIGH_SNR = (8.0, float("inf"))


def naming(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Right names where all that is hidden is listed; of two mechanisms, one is enough.

    Returns
    -------
    dict
        ``all``, ``one`` and ``two`` mechanisms, ``by_snr``, ``around_7`` and ``around_10``.
    """
    listed = [pair for pair in pairs if pair.is_listed]
    two = [pair for pair in listed if len(pair.hidden_effects) > 1]
    return {
        "all": _right(listed),
        "one": _right([pair for pair in listed if len(pair.hidden_effects) == 1]),
        "two": _right(two) | _both(two),
        "by_snr": [{"snr_from": low, "snr_to": high, **_right(within(listed, (low, high)))}
                   for low, high in SNR_BINS],
        "around_7": {"snr_from": AROUND_7[0], "snr_to": AROUND_7[1], **_right(within(listed, AROUND_7))},
        "around_10": {"snr_from": AROUND_10[0], "snr_to": AROUND_10[1], **_right(within(listed, AROUND_10))},
    }  # fmt: skip


def _right(pairs: Sequence[Pair]) -> dict[str, Any]:
    return {
        "n": len(pairs),
        "right_first_name": share([pair.right_name for pair in pairs]),
        "right_class": share([pair.right_class for pair in pairs]),
        "right_set": share([pair.right_set for pair in pairs]),
        "right_set_of_3": share([pair.right_set and len(pair.names) <= LARGEST_SET for pair in pairs]),
        "named_alone": share([pair.named_alone for pair in pairs]),
        "ceiling_right_first_name": _mean_ceiling(RIGHT_NAME_CEILING, pairs),
        "ceiling_named": _mean_ceiling(NAMED_CEILING, pairs),
    }


def _mean_ceiling(table: Ceilings, pairs: Sequence[Pair]) -> float | None:
    """Mean ceiling of some trials; None where one of them has none."""
    values = [ceiling(table, pair.kind, pair.snr) for pair in pairs]
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known and len(known) == len(values) else None


def _both(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Whether both of two mechanisms were found, by leading names and with ties."""
    leading, tied = [], []
    for pair in pairs:
        steps = pair.answer.get("mechanisms") or [] if pair.name else []
        names = {str(step.get("id")) for step in steps} | {str(pair.name)}
        ties = {str(name) for step in steps for name in step.get("tied_with") or ()}
        leading.append(pair.true_ids <= names)
        tied.append(pair.true_ids <= names | ties | set(pair.names))
    return {"both_found": share(leading), "both_in_sets": share(tied)}


def selectivity(pairs: Sequence[Pair]) -> dict[str, Any]:
    """How often what is said is so: single names, tie sets; and whether names are given often enough.

    Names in trials where nothing, or nothing listed, is hidden are wrong.
    """
    alone = [pair for pair in pairs if pair.named_alone]
    tied = [pair for pair in pairs if len(pair.names) > 1]
    one = [pair for pair in pairs if pair.is_listed and len(pair.hidden_effects) == 1]
    counted = [pair for pair in one if ceiling(NAMED_CEILING, pair.kind, pair.snr) is not None]
    expected = [float(ceiling(NAMED_CEILING, pair.kind, pair.snr) or 0.0) for pair in counted]
    return {
        "right_where_named": share([pair.right_name for pair in alone]),
        "right_class_where_named": share([pair.right_class for pair in alone]),
        "set_holds_truth_where_tied": share([pair.right_set for pair in tied]),
        "names_in_tie_sets_median": median([float(len(pair.names)) for pair in tied]),
        "named_over_ceiling": {
            "snr_from": CEILING_SNR[0],
            **estimate([[float(pair.named_alone) for pair in counted], expected], _ratio),
        },
    }


def _ratio(top: Any, bottom: Any) -> Any:
    return np.sum(top, axis=-1) / np.sum(bottom, axis=-1)


def unlisted(pairs: Sequence[Pair]) -> dict[str, Any]:
    """What is said of effects that no list has: any listed name is wrong.

    Returns
    -------
    dict
        ``all``, ``snr_8_and_more``, ``around_10`` and ``by_id``; `place_right`: the true middle lies in the
        stated stretch, or within 100 m of its middle; an answer without a place is not right.
    """
    hidden = [pair for pair in pairs if pair.hidden == "unlisted"]
    ids = sorted({name for pair in hidden for name in pair.true_ids})
    return {
        "all": _unlisted(hidden),
        "snr_8_and_more": {"snr_from": HIGH_SNR[0], **_unlisted(within(hidden, HIGH_SNR))},
        "around_10": {
            "snr_from": AROUND_10[0],
            "snr_to": AROUND_10[1],
            **_unlisted(within(hidden, AROUND_10)),
        },
        "by_id": {name: _unlisted([pair for pair in hidden if name in pair.true_ids]) for name in ids},
    }


def _unlisted(pairs: Sequence[Pair]) -> dict[str, Any]:
    local = [pair for pair in pairs if pair.true_stretches]
    stated = [pair for pair in local if pair.stated_stretch is not None]
    named = [pair for pair in pairs if pair.name]
    return {
        "n": len(pairs),
        "wrong_name": share([pair.name is not None for pair in pairs]),
        "wrong_name_or_failed": share([pair.name is not None or pair.failed for pair in pairs]),
        "wrong_name_is_nearest_listed": share([_nearest(pair) for pair in named]),
        "unexplained": share([pair.verdict == "unexplained" for pair in pairs]),
        "place_right": share([_place_right(pair) for pair in local]),
        "place_right_where_stated": share([_place_right(pair) for pair in stated]),
        "stated_length_m_median": median([_length(pair) for pair in stated]),
    }


def _nearest(pair: Pair) -> bool:
    """Whether a wrong name is that of the listed effect which the true one comes closest to."""
    return pair.name in {one.get("nearest") for one in pair.hidden_effects}


def _length(pair: Pair) -> float:
    place = pair.stated_stretch
    return place[1] - place[0] if place is not None else float("nan")


def _place_right(pair: Pair) -> bool:
    stated, error = pair.stated_stretch, pair.place_error_m
    if stated is None or error is None:
        return False
    return error <= NEAR_M or any(stated[0] <= middle(one) <= stated[1] for one in pair.true_stretches)
