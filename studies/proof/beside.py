"""The diagnosis of a batch beside that of an earlier version of the code, on the same trials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any

from scipy.stats import binomtest

from benchmarks.scorecard_tables import STRONG
from skred.prove.scorecard import DIAGNOSIS
from skred.prove.scoring.answers import Pair, pairs_of
from skred.prove.scoring.probability import log_score

EARLIER = "earlier"
"""Name of the answers of an earlier version, which were computed beside the others."""
Chosen = Callable[[Pair], bool]
_MOST_TIED = 3


def _strong(pair: Pair) -> bool:
    return not pair.is_null and pair.hidden != "masked" and pair.snr >= STRONG


def _strong_listed(pair: Pair) -> bool:
    return _strong(pair) and pair.is_listed


ROWS: tuple[tuple[str, Chosen, Chosen], ...] = (
    ("no alarm where nothing is hidden", lambda p: p.is_null, lambda p: not p.alarm and not p.failed),
    ("alarm, open effect", _strong, lambda p: p.alarm),
    ("right first name", _strong_listed, lambda p: p.right_name),
    (
        f"right name among at most {_MOST_TIED}",
        _strong_listed,
        lambda p: p.right_set and len(p.names) <= _MOST_TIED,
    ),
    ("right set of names", _strong_listed, lambda p: p.right_set),
    (
        "right first name, compensated effect",
        lambda p: p.hidden == "masked" and p.snr >= STRONG,
        lambda p: p.right_name,
    ),
    ("a verdict", lambda p: True, lambda p: not p.failed),
)
"""What is counted, of which trials, and what is good."""


def beside(trials: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]) -> str:
    """A table of both, trial by trial.

    Parameters
    ----------
    trials : sequence of mapping
        With their truths.
    answers : mapping
        By method and trial: `DIAGNOSIS` and `EARLIER`.
    """
    now, then = (pairs_of(trials, answers[method]) for method in (DIAGNOSIS, EARLIER))
    both = list(zip(now, then, strict=True))
    rows = [
        "| what | trials | later | earlier | good by the later only | by the earlier only | p |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for what, chosen, good in ROWS:
        pairs = [(good(one), good(other)) for one, other in both if chosen(one)]
        only = [
            sum(one and not other for one, other in pairs),
            sum(other and not one for one, other in pairs),
        ]
        p_value = binomtest(only[0], sum(only)).pvalue if sum(only) else 1.0
        counts = [sum(one for one, _ in pairs), sum(other for _, other in pairs)]
        rows.append(
            f"| {what} | {len(pairs)} | {counts[0]} | {counts[1]} | {only[0]} | {only[1]} | {p_value:.2g} |"
        )
    return "\n".join([*rows, "", *_sets(now, then), *_sums(now, then)]) + "\n"


def _sets(now: Sequence[Pair], then: Sequence[Pair]) -> list[str]:
    """What is right of what is said: of different trials, because each says it of its own."""
    said = []
    for what, chosen, good in (
        ("Single names that are right", lambda p: p.named_alone, lambda p: p.right_name),
        ("Ties that hold a truth", lambda p: len(p.names) > 1, lambda p: p.right_set),
    ):
        counts = []
        for pairs in (now, then):
            own = [pair for pair in pairs if chosen(pair)]
            counts.append(f"{sum(map(good, own))} of {len(own)}")
        said.append(f"- {what}: later {counts[0]}, earlier {counts[1]}.")
    return said


def _sums(now: Sequence[Pair], then: Sequence[Pair]) -> list[str]:
    """Log scores and times."""
    differences = [log_score(one) - log_score(other) for one, other in zip(now, then, strict=True)]
    said = [f"- Log score of the truth's id: {sum(differences) / len(differences):+.2f} nats a trial."]
    for kind in ("sparse", "dense"):
        times = [[_seconds(pair) for pair in pairs if pair.kind == kind] for pairs in (now, then)]
        if all(times):
            later, earlier = (median(own) for own in times)
            said.append(f"- Median CPU time, {kind}: later {later:.0f} s, earlier {earlier:.0f} s.")
    return said


def _seconds(pair: Pair) -> float:
    """What an answer took; one that is not there took no time."""
    return float(pair.answer.get("cpu_seconds", 0.0))
