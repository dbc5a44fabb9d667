"""Sections of studies/README.md about the campaigns of other hands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skred.prove.scoring.answers import UNLISTED, Pair
from skred.prove.scoring.intervals import share
from studies.another_hand.campaigns import HANDS, Hidden, hidden
from studies.files import RESULTS, read

RIGHT = "right name"
HOLDS = (RIGHT, "in the tie")
"""What an answer is worth that holds the truth."""


def judged(truth: Hidden, answer: dict[str, Any]) -> str:
    """In a word or two what an answer is worth, by the rules of the record of concealed trials."""
    effects = [{"id": name, "listed": name != UNLISTED} for name in truth.ids]
    first = answer["mechanisms"][0] if answer["mechanisms"] else None
    given = {**answer, "mechanism": first, "indistinguishable": answer["tied"]}
    pair = Pair("", {"mechanisms": effects}, given)
    if not truth.ids:
        return "false alarm" if pair.alarm else "right"
    if not pair.alarm:
        return "missed"
    if pair.right_name:
        return RIGHT
    return "in the tie" if pair.right_set else "wrong" if pair.name else pair.verdict


def counted(hits: Sequence[bool]) -> str:
    """So many of so many, with the exact 95 % interval of their share."""
    found = share(hits)
    if not found["n"]:
        return "0 of 0"
    return f"{found['hits']} of {found['n']} ({found['low']:.2f} to {found['high']:.2f})"


def sections() -> str:
    """A section for each hand."""
    return "".join(map(_section, HANDS))


def _section(hand: str) -> str:
    truths, found = hidden(hand), read(RESULTS / "another_hand.json")
    answers, again, faults = (
        {name: one for name, one in found[key].items() if name in truths}
        for key in ("answers", "again", "faults")
    )
    worth = {name: judged(truths[name], answer) for name, answer in answers.items()}
    rows = "".join(_row(name, truths[name], answer, worth[name]) for name, answer in answers.items())
    clean = [worth[name] == "right" for name in answers if not truths[name].ids]
    listed = [one for name, one in worth.items() if truths[name].ids and UNLISTED not in truths[name].ids]
    single = [name for name, one in answers.items() if one["mechanisms"] and not one["tied"]]
    tied = [name for name, one in answers.items() if one["mechanisms"] and one["tied"]]
    versions = ", ".join(dict.fromkeys(one["commit"] for one in answers.values()))
    every = truths.values()
    spreads = [sd for one in every for sd in one.spreads]
    wider = [one.errors for one in every if one.errors > 1.0]
    times = " to ".join(f"{size:g}" for size in sorted({min(wider), max(wider)}))
    return f"""
## Campaigns by another hand: the {hand}

`python -m studies.another_hand` (code {versions}): {len(answers)} campaigns of a simulator that shares
no code with skred's. It was written from the campaign format, the base laws and the list of mechanisms, lies
with the campaigns in `studies/another_hand/{hand}.zip`, and integrates in time. It breaks what trials of
the record assume: coefficients differ between avalanches with an sd of the logarithm of {min(spreads):g}
to {max(spreads):g}, errors are {times} times as large as stated in {len(wider)} campaigns, one
reading is odd in {sum(one.is_odd for one in every)}, and in
{sum(one.differs for one in every)} an effect acts in half of the avalanches only, or differs in strength.
Edges are soft, and exponents others than the library's. Truths were opened after the verdicts.

{_first(faults)}The ratio is the log likelihood ratio with the true effect against without,
population and avalanches refitted. Answers are judged by the rules of the record: entrainment and drag on a
stretch are the same term and are always told together, and what is tied with `unexplained` is no name.

| campaign | base law | hidden | ratio | verdict | tied with | worth |
| --- | --- | --- | --- | --- | --- | --- |
{rows}
- Nothing is claimed where nothing is hidden: {counted(clean)}.
- Listed effects found: {counted([one != "missed" for one in listed])}. The first name is right in
  {counted([one == RIGHT for one in listed])}, name or tie hold the truth in
  {counted([one in HOLDS for one in listed])}.
- Single names that are right: {counted([worth[name] == RIGHT for name in single])}. Ties that hold the truth:
  {counted([worth[name] in HOLDS for name in tied])}.
{_since(answers, again)}"""


def _since(answers: dict[str, dict[str, Any]], again: dict[str, dict[str, Any]]) -> str:
    """What later code says otherwise; empty where nothing was diagnosed again."""
    if not again:
        return ""
    others = [name for name, one in again.items() if _says(one) != _says(answers[name])]
    changed = "; ".join(f"{name}: {_says(again[name])} instead of {_says(answers[name])}" for name in others)
    versions = ", ".join(dict.fromkeys(one["commit"] for one in again.values()))
    return (
        f"- By later code ({versions}), with the truths known, {len(again)} were diagnosed again"
        f" ({', '.join(again)}). Other names: {changed or 'none'}.\n"
    )


def _says(answer: dict[str, Any]) -> str:
    return " + ".join(answer["mechanisms"]) or str(answer["verdict"])


def _first(faults: dict[str, str]) -> str:
    """Which ended with a fault when they were first diagnosed; empty where none did."""
    if not faults:
        return ""
    listed = ", ".join(f"{name}: {what}" for name, what in faults.items())
    return (
        f"When they were first diagnosed, {len(faults)} ended with a fault ({listed}), which was mended;\n"
        "their answers are by the mended code. "
    )


def _row(name: str, truth: Hidden, answer: dict[str, Any], worth: str) -> str:
    ratio = "" if truth.log_likelihood_ratio is None else f"{truth.log_likelihood_ratio:.0f}"
    what = f"{', '.join(truth.ids)}: {truth.note}" if truth.ids else "nothing"
    cells = (
        name,
        truth.base_model,
        what.replace("|", "/"),
        ratio,
        _says(answer),
        ", ".join(answer["tied"]),
        worth,
    )
    return f"| {' | '.join(cells)} |\n"
