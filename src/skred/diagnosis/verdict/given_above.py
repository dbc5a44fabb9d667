"""What the readings above say better with what was added, in words; and where nothing is gained."""

from __future__ import annotations

from typing import Any

from scipy.stats import binom

from skred.diagnosis.limits import LIMIT
from skred.diagnosis.words import MOST_NAMED, counted, error_texts
from skred.inference.influence_words import enumerated
from skred.inference.intervals import PRACTICAL_DIFFERENCE
from skred.units import unit_text

CLEAR, UNCLEAR, NOTHING_GAINED, WORSE = "better", "no clear gain", "nothing gained", "worse"
"""What may have been gained at a sensor."""
_KINDS = {
    CLEAR: "Better",
    UNCLEAR: "No clear gain",
    NOTHING_GAINED: "Practically unchanged",
    WORSE: "Worse",
}
"""As it is told."""


def given_above(document: dict[str, Any], moving: tuple[int, int]) -> str:
    """What is gained at which sensor, as one sentence or a few.

    Parameters
    ----------
    moving : (int, int)
        Speeds above nil that have a reading above them, and how many lie in their 90 % intervals.
    """
    rows = _rows(document)
    if not rows:
        return "No avalanche has two readings, so none is predicted from those above it."
    parts = [f"Given the readings of the same avalanche above it, {_gains(rows, 'all')}", _each(document)]
    parts.append(_within(*moving))
    carried = [row for row in rows if row[2]["carrying"] is not None]
    if carried:
        alone = [f"{name} ({_change(sets['carrying'], unit)})" for name, unit, sets in carried]
        parts.append(f"The avalanches that carry the answer, by themselves: {enumerated(alone)}.")
    rest = [row for row in carried if row[2]["others"] is not None]
    if rest:
        parts.append(f"Without them, {_gains(rest, 'others')}")
    return " ".join(part for part in (*parts, "After ± stands twice the standard error.") if part)


def _each(document: dict[str, Any]) -> str:
    """What is gained at the sensors one by one, where they were told of together."""
    speeds = _speeds(document)
    if len(speeds) <= MOST_NAMED:
        return ""
    gains = [gain_of(row["all"]) for row in speeds]
    said = [f"{gains.count(gain)} {gain}" for gain in _KINDS if gain in gains]
    return f"Of these sensors by themselves: {', '.join(said)}."


def _within(n: int, inside: int) -> str:
    """That errors are smaller than stated, where more readings than chance has lie in their intervals."""
    if binom.sf(inside - 1, n, 0.9) > LIMIT:
        return ""
    return (
        f"In their 90 % intervals lie {inside} of {counted(n, 'speed')}, more than by chance: readings"
        " probably scatter less than their stated errors, and with smaller ones could tell more apart."
    )


def _gains(rows: list[tuple[str, str, dict[str, Any]]], which: str) -> str:
    """What is better over some avalanches, and all that is not; begins with a small letter."""
    told: dict[str, list[str]] = {CLEAR: [], UNCLEAR: [], NOTHING_GAINED: [], WORSE: []}
    for name, unit, sets in rows:
        told[gain_of(sets[which])].append(f"{name} ({_change(sets[which], unit)})")
    first = "no reading is clearly predicted better with what was added."
    if told[CLEAR]:
        first = f"what was added improves the prediction of {enumerated(told[CLEAR])}."
    others = ((one, words) for one, words in _KINDS.items() if one != CLEAR and told[one])
    return " ".join((first, *(f"{words}: {enumerated(told[one])}." for one, words in others)))


def gain_of(scores: dict[str, Any]) -> str:
    """What was gained at a sensor, in a word.

    A change of the log score of all its readings counts from 4 nats on and beyond twice its standard error,
    as for avalanches left out. A gain is clear if the error does not grow besides.
    """
    n, doubled = scores["n"], scores["log_score_diff_2se"]
    change, grows = n * scores["log_score_diff"], scores["rmse_diff"] > 0.0
    if abs(change) < PRACTICAL_DIFFERENCE:
        return NOTHING_GAINED
    if doubled is None or abs(change) < n * doubled:
        return UNCLEAR
    if change < 0.0:
        return WORSE
    return UNCLEAR if grows else CLEAR


def _rows(document: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """Name, unit and scores of what is told of."""
    sensors, speeds = document["sensors"], _speeds(document)
    rows = [(_name(row), row["unit"], row) for row in sensors]
    if len(speeds) <= MOST_NAMED:
        return rows
    pooled = (f"the speeds at {len(speeds)} sensors together", "m s-1", document["speeds"])
    return [pooled, *(row for row, one in zip(rows, sensors, strict=True) if one["quantity"] == "runout")]


def _speeds(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Those of sensors of speed."""
    return [row for row in document["sensors"] if row["quantity"] != "runout"]


def _name(row: dict[str, Any]) -> str:
    return "the runout" if row["quantity"] == "runout" else f"the speed at {row['sensor']}"


def _change(scores: dict[str, Any], unit: str) -> str:
    """Errors before and after, and by how much the log score of all readings together rises."""
    n, doubled = scores["n"], scores["log_score_diff_2se"]
    error = "" if doubled is None else f" ± {n * doubled:.1f}"
    return (
        f"error {_errors(scores, unit)}, log score {_signed(n * scores['log_score_diff'])}{error},"
        f" {counted(n, 'reading')}"
    )


def _errors(scores: dict[str, Any], unit: str) -> str:
    before, after = error_texts([scores["rmse_before"], scores["rmse_after"]], unit)
    return (
        f"{before} {unit_text(unit)} as before"
        if before == after
        else f"{before} to {after} {unit_text(unit)}"
    )


def _signed(value: float) -> str:
    text = f"{value:+.1f}"
    return "0.0" if float(text) == 0.0 else text
