"""What was said of what was hidden: a table of counts over mechanisms, and one over classes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from skred.prove.scoring.answers import FAILURES, Pair
from skred.prove.scoring.standards import STRENGTHS, TIES, class_of

_OTHER_ROWS = ("two", "unlisted", "nothing", "nasty")
_OTHER_COLUMNS = ("unexplained", "nothing_missing", "cannot_tell", "crash")
"""Without a name; time-outs count as crashes."""


def confusion(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Counts over mechanisms and over classes: rows are truths, columns leading names or verdicts."""
    return {"mechanisms": _table(pairs, str), "classes": _table(pairs, class_of)}


def _table(pairs: Sequence[Pair], label: Callable[[str], str]) -> dict[str, Any]:
    listed = list(dict.fromkeys(label(name) for name in _ids()))
    counts: dict[tuple[str, str], int] = {}
    for pair in pairs:
        cell = _row(pair, label), _column(pair, label)
        counts[cell] = counts.get(cell, 0) + 1
    rows = _present([*listed, *_OTHER_ROWS], [row for row, _ in counts])
    columns = [*_present(listed, [column for _, column in counts if column not in _OTHER_COLUMNS])]
    columns += list(_OTHER_COLUMNS)
    return {
        "rows": rows,
        "columns": columns,
        "counts": [[counts.get((row, column), 0) for column in columns] for row in rows],
    }


def _ids() -> list[str]:
    """Listed ids, those of one tie beside each other."""
    return list(dict.fromkeys([*(name for tie in TIES for name in tie.ids), *STRENGTHS]))


def _present(order: Sequence[str], found: Sequence[str]) -> list[str]:
    """What was found, in a given order, strangers last."""
    return [name for name in order if name in found] + sorted(set(found) - set(order))


def _row(pair: Pair, label: Callable[[str], str]) -> str:
    if pair.is_null or pair.hidden == "unlisted":
        return pair.hidden
    return "two" if len(pair.hidden_effects) > 1 else label(next(iter(pair.true_ids)))


def _column(pair: Pair, label: Callable[[str], str]) -> str:
    if pair.name:
        return label(pair.name)
    return "crash" if pair.verdict in FAILURES or pair.verdict not in _OTHER_COLUMNS else pair.verdict
