"""The scorecard of concealed trials: scores, acceptance criteria and comparisons as data."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skred.output import plain, write_json
from skred.prove.scoring.answers import Pair, pairs_of
from skred.prove.scoring.criteria import acceptance_criteria
from skred.prove.scoring.intervals import LEVEL, RESAMPLES, SEED
from skred.prove.scoring.paired import compare
from skred.prove.scoring.places import right_stretch
from skred.prove.scoring.scores import KINDS, of_kind, scores_by_kind
from skred.prove.scoring.standards import as_plain

DIAGNOSIS = "skred"
"""The method that is on trial; all others are baselines."""


def write_scorecard(
    folder: Path,
    ledger: Mapping[str, Any],
    trials: Sequence[Mapping[str, Any]],
    answers: Mapping[str, Mapping[str, Mapping[str, Any]]],
) -> dict[str, Any]:
    """Score all answers and write ``scorecard.json``, from which page and figures are made.

    Parameters
    ----------
    folder : Path
        Made if it does not exist; files of the same names are replaced.
    ledger : mapping
        What was published before the first diagnosis; its single values head the page.
    trials : sequence of mappings
        ``trial`` and ``truth`` of each.
    answers : mapping
        By method, then by trial. A trial without an answer counts as a crash.

    Returns
    -------
    dict
        The scorecard as plain data.
    """
    document = scorecard(ledger, trials, answers)
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "scorecard.json", document)
    return document


def scorecard(
    ledger: Mapping[str, Any],
    trials: Sequence[Mapping[str, Any]],
    answers: Mapping[str, Mapping[str, Mapping[str, Any]]],
) -> dict[str, Any]:
    """The scorecard as plain data, see `write_scorecard`."""
    pairs = {
        method: pairs_of(trials, answers.get(method, {})) for method in dict.fromkeys([DIAGNOSIS, *answers])
    }
    methods = {method: scores_by_kind(those) for method, those in pairs.items()}
    paired = {
        method: {kind: compare(_open(pairs[DIAGNOSIS], kind), _open(those, kind)) for kind in KINDS}
        for method, those in pairs.items()
        if method != DIAGNOSIS
    }
    document: dict[str, Any] = plain(
        {
            "format": 1,
            "diagnosis": DIAGNOSIS,
            "n_trials": len(trials),
            "counts": _counts(pairs[DIAGNOSIS]),
            "interval": {"probability": LEVEL, "n_resamples": RESAMPLES, "seed": SEED},
            "standards": as_plain(),
            "ledger": {key: value for key, value in ledger.items() if _is_single(value)},
            "bars": acceptance_criteria(methods[DIAGNOSIS]["open"], paired),
            "methods": methods,
            "paired": paired,
            "trials": [_line(pair) for pair in pairs[DIAGNOSIS]],
        }
    )
    return document


def _open(pairs: Sequence[Pair], kind: str) -> list[Pair]:
    return [pair for pair in of_kind(pairs, kind) if not pair.truth.get("masked")]


def _counts(pairs: Sequence[Pair]) -> dict[str, dict[str, int]]:
    """Number of trials by what is hidden, for each kind."""
    return {kind: dict(sorted(Counter(p.hidden for p in of_kind(pairs, kind)).items())) for kind in KINDS}


def _is_single(value: Any) -> bool:
    return value is None or isinstance(value, (str, int, float, bool))


def _line(pair: Pair) -> dict[str, Any]:
    """One trial in one line."""
    return {
        "trial": pair.trial,
        "seed": pair.truth.get("seed"),
        "kind": pair.kind,
        "base_model": pair.truth.get("base_model"),
        "hidden": pair.hidden,
        "nasty": pair.truth.get("nasty"),
        "true_ids": [str(one["id"]) for one in pair.hidden_effects],
        "snr": pair.snr,
        "verdict": pair.verdict,
        "names": pair.names,
        "probability_nothing": pair.probability.get("nothing"),
        "p_value": pair.number("evidence", "p_value"),
        "right": _right(pair),
        "right_stretch": right_stretch(pair) if pair.true_stretches else None,
        "place_error_m": pair.place_error_m,
        "wall_seconds": pair.number("wall_seconds"),
        "cpu_seconds": pair.number("cpu_seconds"),
    }


def _right(pair: Pair) -> str:
    """How right an answer is, in a word."""
    if pair.failed:
        return "failed"
    if pair.is_null:
        return "false alarm" if pair.alarm else "right"
    if not pair.alarm:
        return "not found"
    if pair.right_name or (not pair.is_listed and not pair.name):
        return "right"
    if pair.right_set:
        return "in the set"
    return "right class" if pair.right_class else "wrong name" if pair.name else "found, no name"
