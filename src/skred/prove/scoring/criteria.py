"""The acceptance criteria set in advance, as measured: met, not met, or too few trials to say.

A criterion is judged by the point estimate, for false alarms by the one-sided upper limit;
``beyond_doubt`` says whether the whole interval lies on the same side. With fewer than 20
trials (100 for the calibration of probabilities) none is called met, and not met only where the whole
interval says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from skred.prove.scoring.intervals import upper_limit
from skred.prove.scoring.standards import (
    DETECTION_CRITERIA,
    FALSE_ALARM_CRITERIA,
    IDENTIFY_LIMIT_S,
    LIMIT_S,
    NAMING_CRITERIA,
    PLACE_CRITERION_M,
)

MET, NOT_MET, TOO_FEW = "met", "not met", "too few trials to say"
_LEAST_N = 20
_LEAST_N_ECE = 100


@dataclass(frozen=True)
class Criterion:
    """An acceptance criterion, and how it is told.

    Attributes
    ----------
    goal, what : str
        The goal in one word, and what exactly is measured.
    at_least, at_most : float, optional
        The limit.
    unit : str
        ``1`` for shares and ratios.
    least_n : int
        Fewest trials by which a point estimate is called.
    note : str
    """

    goal: str
    what: str
    at_least: float | None = None
    at_most: float | None = None
    unit: str = "1"
    least_n: int = _LEAST_N
    note: str = ""


def acceptance_criteria(
    skred: Mapping[str, Any], paired: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Every criterion as a row.

    Parameters
    ----------
    skred : mapping
        Scores of the diagnosis on open trials, by kind.
    paired : mapping
        Comparisons with each baseline, by kind.
    """
    return [
        *_alarm_rows(skred["all"]),
        *_naming_rows(skred),
        *_selectivity_rows(skred["all"]),
        *_probability_rows(skred["all"], paired),
        *_unlisted_rows(skred),
        *_place_rows(skred),
        *_improvement_rows(skred["all"]),
        *_time_rows(skred),
        *_baseline_rows(paired),
    ]


def _alarm_rows(scores: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    words = {"all": "nulls, plain and contaminated", "plain": "plain nulls", "nasty": "contaminated nulls"}
    for key, what in words.items():
        found, most = scores["false_alarms"][key], FALSE_ALARM_CRITERIA[key]
        note = (
            f"{found['hits']} alarms, and {found['failures']} crashes or time-outs that count as alarms here"
        )
        criterion = Criterion("false alarms", f"{what}: one-sided 95 % upper limit", at_most=most, note=note)
        yield _alarm_row(criterion, found["with_failures"])
    for at, least in DETECTION_CRITERIA.items():
        criterion = Criterion(
            "detection", f"found at signal-to-noise {at}, by a logistic fit", at_least=least
        )
        yield _row(criterion, scores["detection"]["fit"]["at"][at])


def _alarm_row(criterion: Criterion, found: Mapping[str, Any]) -> dict[str, Any]:
    """A criterion on an upper limit: too few trials could not meet it even without an alarm."""
    limit, n, most = found["upper_limit_one_sided_95"], found["n"], criterion.at_most or 0.0
    row = _row(criterion, {"n": n, "value": limit})
    best = upper_limit([False] * n)
    if limit is None or best is None:
        return row | {"status": TOO_FEW, "beyond_doubt": False}
    if limit < most:
        return row | {"status": MET, "beyond_doubt": True}
    wrong = found["low"] > most
    status = NOT_MET if wrong or best < most else TOO_FEW
    return row | {"status": status, "beyond_doubt": wrong}


def _naming_rows(skred: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for kind, (name, of_set) in NAMING_CRITERIA.items():
        found = skred[kind]["naming"]["around_7"]
        around = f"at signal-to-noise {found['snr_from']:g} to {found['snr_to']:g}, {kind}"
        ceiling = found["ceiling_right_first_name"]
        yield _row(
            Criterion("naming", f"right first name {around}", at_least=name),
            found["right_first_name"],
            ceiling,
        )
        criterion = Criterion("naming", f"right tie set of at most 3 {around}", at_least=of_set)
        yield _row(criterion, found["right_set_of_3"])


def _selectivity_rows(scores: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    found = scores["honesty"]
    criterion = Criterion("selectivity", "right where a single name is given", at_least=0.95)
    yield _row(criterion, found["right_where_named"])
    criterion = Criterion("selectivity", "tie sets that hold the truth", at_least=0.93)
    yield _row(criterion, found["set_holds_truth_where_tied"])
    note = "one listed effect, signal-to-noise 4 and more"
    criterion = Criterion(
        "selectivity", "single names given, over what the ceiling expects", at_least=0.6, note=note
    )
    yield _row(criterion, found["named_over_ceiling"])


def _probability_rows(
    scores: Mapping[str, Any], paired: Mapping[str, Mapping[str, Any]]
) -> Iterator[dict[str, Any]]:
    stated = scores["probability"]
    for key, words in (("top_id", "the most probable id"), ("all_ids", "all ids")):
        found = (stated or {}).get(key, {}).get("ece_less_expected")
        what = f"ECE of {words} less its expectation under perfect calibration"
        yield _row(Criterion("probabilities", what, at_most=0.03, least_n=_LEAST_N_ECE), found)
    for name, comparison in paired.items():
        found = comparison["all"]["log_score_difference_nats"]
        note = "one of the two states no probabilities" if found is None else ""
        what = f"log score per trial less that of {name}"
        yield _row(Criterion("probabilities", what, at_least=0.0, unit="nats", note=note), found)


def _unlisted_rows(skred: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for kind, most in (("dense", 0.15), ("sparse", 0.35)):
        found = skred[kind]["unlisted"]["around_10"]
        around = f"at signal-to-noise {found['snr_from']:g} to {found['snr_to']:g}, {kind}"
        criterion = Criterion("unlisted truth", f"a listed name, or none for a crash, {around}", at_most=most)
        yield _row(criterion, found["wrong_name_or_failed"])
    found = skred["all"]["unlisted"]["snr_8_and_more"]
    criterion = Criterion("unlisted truth", "its place right, signal-to-noise 8 and more", at_least=0.85)
    yield _row(criterion, found["place_right"])


def _place_rows(skred: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    criterion = Criterion("place", "median error, dense", at_most=PLACE_CRITERION_M, unit="m")
    yield _row(criterion, skred["dense"]["place"]["error"]["median_m"])
    found = skred["sparse"]["place"]["right_stretch_around_7"]
    around = f"at signal-to-noise {found['snr_from']:g} to {found['snr_to']:g}, sparse"
    yield _row(Criterion("place", f"right stretch {around}", at_least=0.80), found)


def _improvement_rows(scores: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    criterion = Criterion("improvement", "held-out log score better where something is named", at_least=0.90)
    yield _row(criterion, scores["held_out"]["better_where_named"])
    criterion = Criterion(
        "improvement", "realised over promised gain on fresh avalanches", at_least=0.8, at_most=1.2
    )
    yield _row(criterion, scores["gain"]["realised_over_promised"])
    found = scores["strength"]
    note = f"{found['n_not_comparable']} not comparable"
    what = "90 % intervals that hold the true strength, given selection"
    yield _row(Criterion("strength", what, at_least=0.85, at_most=0.95, note=note), found["coverage_90"])


def _time_rows(skred: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for kind, most in LIMIT_S.items():
        found = skred[kind]["time"]["wall"]
        longest, median = found["max_seconds"], found["median_seconds"]["value"]
        note = "" if longest is None else f"longest {longest:.0f} s, median {median:.0f} s"
        criterion = Criterion("time", f"nine in ten verdicts, {kind}", at_most=most, unit="s", note=note)
        yield _row(criterion, found["quantile_90_seconds"])
    note = "the step alone, without the calibration before it"
    criterion = Criterion(
        "time", "nine in ten identifiability tables", at_most=IDENTIFY_LIMIT_S, unit="s", note=note
    )
    yield _row(criterion, skred["all"]["time"]["identify_step_quantile_90_seconds"])


def _baseline_rows(paired: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for name, comparison in paired.items():
        for kind in ("sparse", "dense"):
            found = comparison[kind]["right_first_name"]
            what = f"right first names less those of {name} at equal false alarms, {kind}"
            record = {
                "n": comparison[kind]["n_listed"], "value": found["difference"],
                "low": found["low"], "high": found["high"],
            }  # fmt: skip
            yield _row(Criterion("baselines", what, at_least=0.0, note="a tie is not ahead"), record)


def _row(
    criterion: Criterion, found: Mapping[str, Any] | None, ceiling: float | None = None
) -> dict[str, Any]:
    """A criterion beside what was measured."""
    found = found or {}
    value, low, high = found.get("share", found.get("value")), found.get("low"), found.get("high")
    n = int(found.get("n") or 0)
    status, sure = judge(criterion, value, low, high, n)
    return {
        "goal": criterion.goal,
        "what": criterion.what,
        "at_least": criterion.at_least,
        "at_most": criterion.at_most,
        "unit": criterion.unit,
        "measured": value,
        "low": low,
        "high": high,
        "n": n,
        "ceiling": ceiling,
        "status": status,
        "beyond_doubt": sure,
        "note": criterion.note,
    }


def judge(
    criterion: Criterion, value: float | None, low: float | None, high: float | None, n: int
) -> tuple[str, bool]:
    """Whether a criterion is met, and whether the whole interval says so."""
    if value is None:
        return TOO_FEW, False
    good = _holds(criterion, value)
    if low is None or high is None:
        return (MET if good else NOT_MET, False) if n >= criterion.least_n else (TOO_FEW, False)
    inside = _holds(criterion, low) and _holds(criterion, high)
    outside = (criterion.at_least is not None and high < criterion.at_least) or (
        criterion.at_most is not None and low > criterion.at_most
    )
    sure = inside if good else outside
    if n < criterion.least_n and (good or not sure):
        return TOO_FEW, False
    return (MET if good else NOT_MET), sure


def _holds(criterion: Criterion, value: float) -> bool:
    """A limit of 0 on a difference must be passed, not reached."""
    low_enough = criterion.at_most is None or value <= criterion.at_most
    if criterion.at_least == 0.0:
        return value > 0.0 and low_enough
    return low_enough and (criterion.at_least is None or value >= criterion.at_least)
