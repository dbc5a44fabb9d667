"""The first paragraph of a scorecard, for readers who know avalanches and no statistics."""

from __future__ import annotations

from typing import Any

from skred.report.shared.document import Document, get


def lay_words(document: Document) -> list[str]:
    """Sentences that say what was tried, and how often the diagnosis was right, in counts."""
    own = get(document, "methods", str(get(document, "diagnosis")), "open", "all")
    told = [
        f"How often is the diagnosis right? It was given {get(document, 'n_trials')} made-up campaigns whose"
        " answer was laid aside and sealed beforehand: in some a force or a fault of an instrument is hidden,"
        " in others nothing."
    ]
    alarms = _of(own, "false_alarms", "all")
    if alarms:
        told.append(f"Where nothing was hidden it saw something in {alarms}.")
    found = _of(own, "detection", "all")
    if found:
        told.append(f"Where something was hidden, often weak, it noticed that in {found}.")
    first = _of(own, "naming", "all", "right_first_name")
    if first:
        told.append(f"Of hidden causes on its list it put the right one first in {first}.")
    alone = _of(own, "honesty", "right_where_named")
    if alone:
        told.append(f"Where it gave one name only, that was right in {alone}.")
    wrong = _of(own, "unlisted", "all", "wrong_name")
    if wrong:
        told.append(f"Hidden causes that are on no list got a wrong name in {wrong}.")
    return told


def _of(scores: Any, *keys: str) -> str:
    """Counts in words; empty where there were no trials."""
    found = get(scores, *keys)
    n, hits = get(found, "n"), get(found, "hits")
    return f"{hits} of {n} cases" if n else ""
