"""Whether stated probabilities mean what they say: reliability, ECE, log score, Brier score.

The hidden id is to be probable: `nothing` where nothing is hidden, contaminated or not; `unlisted` for what
no list has; of two mechanisms either, their probabilities added. One id against the rest: trials with two are
left out of the reliability of all ids, because two statements cannot both be right there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.prove.scoring.answers import Pair
from skred.prove.scoring.intervals import SEED, interval_of, mean, resamples, share
from skred.prove.scoring.standards import LOG_SCORE_FLOOR

N_BINS = 10
_SIMULATIONS = 2000
_RESAMPLES = 500


def probabilities(pairs: Sequence[Pair]) -> dict[str, Any] | None:
    """All scores of stated probabilities; None where no answer states any."""
    stated = [pair for pair in pairs if pair.probability]
    if not stated:
        return None
    single = [pair for pair in stated if len(pair.probable_ids) == 1]
    return {
        "n_stated": len(stated),
        "n_not_stated": len(pairs) - len(stated),
        "top_id": _reliability([_top(pair) for pair in stated]),
        "all_ids": _reliability([_every(pair) for pair in single]),
        "log_score_mean_nats": mean([log_score(pair) for pair in pairs]),
        "log_score_mean_nats_where_stated": mean([log_score(pair) for pair in stated]),
        "brier_mean": mean([brier(pair) for pair in pairs]),
    }


def log_score(pair: Pair) -> float:
    """Logarithm of the probability of the truth, at least of the floor, which stands where none is stated."""
    return float(np.log(max(_of_truth(pair), LOG_SCORE_FLOOR)))


def brier(pair: Pair) -> float:
    """Sum of squares of stated probabilities less the truth, 0 to 2; 1 where none is stated."""
    rest = [value for name, value in pair.probability.items() if name not in pair.probable_ids]
    return float((1.0 - _of_truth(pair)) ** 2 + np.sum(np.square(rest)))


def _of_truth(pair: Pair) -> float:
    return float(sum(pair.probability.get(name, 0.0) for name in pair.probable_ids))


def _top(pair: Pair) -> tuple[FloatArray, BoolArray]:
    """The largest probability, and whether its id is the truth."""
    name = max(pair.probability, key=lambda one: pair.probability[one])
    return np.array([pair.probability[name]]), np.array([name in pair.probable_ids])


def _every(pair: Pair) -> tuple[FloatArray, BoolArray]:
    """The probability of each id and of the truth, and whether it is the truth."""
    names = sorted(set(pair.probability) | pair.probable_ids)
    stated = np.array([pair.probability.get(name, 0.0) for name in names])
    return stated, np.array([name in pair.probable_ids for name in names])


Case = tuple[FloatArray, BoolArray]


def _reliability(cases: Sequence[Case]) -> dict[str, Any]:
    """Reliability curve, ECE, and the ECE that perfectly calibrated statements would show."""
    if not cases:
        return {"n_trials": 0, "n_statements": 0, "bins": [], "ece": None}
    stated = np.concatenate([case[0] for case in cases])
    true = np.concatenate([case[1] for case in cases])
    n, excess = per_trial_sums(cases)
    ece = float(ece_of(n, excess))
    simulated = ece_if_calibrated(cases)
    index = resamples(len(cases), _RESAMPLES)
    again = ece_of(n[index], excess[index])
    low, high = interval_of(again - again.mean() + ece - simulated.mean())
    expected_low, expected_high = interval_of(simulated)
    return {
        "n_trials": len(cases),
        "n_statements": len(stated),
        "bins": _bins(stated, true),
        "ece": ece,
        "ece_expected_if_calibrated": float(simulated.mean()),
        "ece_if_calibrated_low": expected_low,
        "ece_if_calibrated_high": expected_high,
        "ece_less_expected": {
            "n": len(cases),
            "value": ece - float(simulated.mean()),
            "low": low,
            "high": high,
        },
    }


def bin_of(stated: FloatArray) -> IntArray:
    """Number of the bin of each probability; 1 belongs to the last."""
    return np.clip((stated * N_BINS).astype(np.int64), 0, N_BINS - 1)


def _bins(stated: FloatArray, true: BoolArray) -> list[dict[str, Any]]:
    number = bin_of(stated)
    rows = []
    for k in range(N_BINS):
        inside = number == k
        rows.append(
            {
                "probability_from": k / N_BINS,
                "probability_to": (k + 1) / N_BINS,
                "mean_stated": float(stated[inside].mean()) if inside.any() else None,
                **share(list(true[inside])),
            }
        )
    return rows


def per_trial_sums(cases: Sequence[Case]) -> tuple[FloatArray, FloatArray]:
    """Of each trial, for each bin: number of statements, sum of stated less true; (n_trials, 10) each."""
    n, excess = np.zeros((len(cases), N_BINS)), np.zeros((len(cases), N_BINS))
    for row, (stated, true) in enumerate(cases):
        number = bin_of(stated)
        np.add.at(n[row], number, 1.0)
        np.add.at(excess[row], number, stated - true)
    return n, excess


def ece_of(n: FloatArray, excess: FloatArray) -> FloatArray:
    """Expected calibration error from sums per trial and bin, (..., n_trials, 10)."""
    return np.asarray(np.abs(excess.sum(axis=-2)).sum(axis=-1) / n.sum(axis=(-2, -1)))


def ece_if_calibrated(cases: Sequence[Case]) -> FloatArray:
    """ECE of simulated trials in which the stated probabilities are exactly right, (n_simulations,).

    The truth of each trial is drawn from its stated probabilities: yes or no where there is one statement,
    else one of the ids.
    """
    rng = np.random.default_rng(SEED)
    hits = np.zeros((_SIMULATIONS, N_BINS))
    total, n = np.zeros(N_BINS), 0
    runs = np.arange(_SIMULATIONS)
    for stated, _ in cases:
        number = bin_of(stated)
        np.add.at(total, number, stated)
        n += len(stated)
        drawn = rng.random(_SIMULATIONS)
        if len(stated) == 1:
            hits[:, number[0]] += drawn < stated[0]
        else:
            ends = np.cumsum(stated) / max(float(stated.sum()), 1e-300)
            hits[runs, number[np.minimum(np.searchsorted(ends, drawn), len(stated) - 1)]] += 1.0
    return np.asarray(np.abs(total - hits).sum(axis=1) / n)
