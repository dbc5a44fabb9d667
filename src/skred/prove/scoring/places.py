"""Where and how strong: place errors, right stretches, and whether intervals hold true strengths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skred.prove.scoring.answers import Pair, at, finite, overlap_m, stretch, within
from skred.prove.scoring.intervals import median, quantile, share
from skred.prove.scoring.standards import AROUND_7, CREDIBLE, STRENGTHS

LEAST_OVERLAP = 0.5
"""Part of the shorter of two stretches that must be shared for the stated one to be right."""


def places(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Place errors of answers with a place where the truth has one, and shares of right stretches.

    An error is the distance between the middles of the stated and the nearest true stretch. Shares of right
    stretches count answers without a place as wrong. Listed effects only; for others see `unlisted`.
    """
    local = [pair for pair in pairs if pair.is_listed and pair.true_stretches]
    named = [pair for pair in local if pair.right_set]
    ids = sorted(
        {str(one["id"]) for pair in local for one in pair.hidden_effects if stretch(one) is not None}
    )
    return {
        "error": _errors(local),
        "error_where_set_is_right": _errors(named),
        "by_id": {name: _errors([pair for pair in local if name in pair.true_ids]) for name in ids},
        "right_stretch": share([right_stretch(pair) for pair in local]),
        "right_stretch_around_7": {
            "snr_from": AROUND_7[0],
            "snr_to": AROUND_7[1],
            **share([right_stretch(pair) for pair in within(local, AROUND_7)]),
        },
        "right_stretch_where_stated": share(
            [right_stretch(pair) for pair in local if pair.stated_stretch is not None]
        ),
    }


def _errors(pairs: Sequence[Pair]) -> dict[str, Any]:
    errors = [error for pair in pairs if (error := pair.place_error_m) is not None]
    return {
        "n_local": len(pairs),
        "median_m": median(errors),
        "quantile_90_m": quantile(errors, 0.9),
    }


def right_stretch(pair: Pair) -> bool:
    """Whether the stated stretch shares at least half of the shorter of the two with a true one."""
    stated = pair.stated_stretch
    if stated is None:
        return False
    return any(
        overlap_m(one, stated) >= LEAST_OVERLAP * max(min(one[1] - one[0], stated[1] - stated[0]), 1e-9)
        for one in pair.true_stretches
    )


def strengths(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Whether the 90 % interval, mean +- 1.645 sd, holds the true strength where the right name was given.

    Not comparable are answers whose parameter or unit is another, whose covariate or sensor is another, and
    true effects that are opposed on the same stretch. True shapes differ from the models' on purpose, so
    the true strength is itself that of a stand-in.
    """
    named = [pair for pair in pairs if pair.right_name]
    compared = [(pair, one) for pair in named if (one := comparable(pair)) is not None]
    ids = sorted({str(one["id"]) for _, one in compared})
    relative = [
        (pair.number("strength", "mean") or 0.0) / float(one["strength"])
        for pair, one in compared
        if one["strength"]
    ]
    return {
        "n_right_name": len(named),
        "n_not_comparable": len(named) - len(compared),
        "coverage_90": share([_covers(pair, one) for pair, one in compared]),
        "by_id": {
            name: share([_covers(pair, one) for pair, one in compared if one["id"] == name]) for name in ids
        },
        "mean_over_truth_median": median(relative),
    }


def comparable(pair: Pair) -> Mapping[str, Any] | None:
    """The named effect as the truth has it, if its strength and the stated one are the same quantity."""
    truth = next(one for one in pair.hidden_effects if one["id"] == pair.name)
    words = STRENGTHS.get(str(pair.name))
    stated = (at(pair.answer, "strength", "parameter"), at(pair.answer, "strength", "unit"))
    if words is None or truth["parameter"] != words[0] or stated != (words[1], truth["unit"]):
        return None
    if truth.get("opposed_by") is not None or pair.number("strength", "sd") is None:
        return None
    other = any(truth.get(key) not in (None, pair.answer.get(key)) for key in ("covariate", "sensor"))
    return None if other else truth


def _covers(pair: Pair, truth: Mapping[str, Any]) -> bool:
    mean, sd, true = pair.number("strength", "mean"), pair.number("strength", "sd"), finite(truth["strength"])
    return None not in (mean, sd, true) and abs(mean - true) <= CREDIBLE * sd  # type: ignore[operator]
