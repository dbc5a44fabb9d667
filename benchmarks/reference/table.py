"""How far the diagnosis is from the reference: all pairs, and parts of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

FAR = 3.0
"""Nats that are a wrong answer."""
BIG = 10.0
"""Log Bayes factor of an effect that must not be lost."""
Record = dict[str, Any]
PARTS: dict[str, Callable[[Record], str]] = {
    "base": lambda one: one["base"],
    "recorded": lambda one: one["recorded"],
    "source": lambda one: one["source"],
    "shapes": lambda one: "averaged" if len(one["shapes"]) > 1 else "one shape",
    "mechanism": lambda one: one["mechanism"],
}


def summary(records: Sequence[Record]) -> dict[str, Any]:
    """Differences of all pairs and of each part."""
    found: dict[str, Any] = {"all": _part(records)}
    for name, key in PARTS.items():
        values = sorted({key(one) for one in records})
        found[name] = {value: _part([one for one in records if key(one) == value]) for value in values}
    return found


def difference(record: Record) -> float:
    """Engine less reference; infinite where the engine failed."""
    factor = record["engine"]["log_bayes_factor"]
    return np.inf if factor is None else float(factor) - float(record["reference"]["log_bayes_factor"])


def _part(records: Sequence[Record]) -> dict[str, Any]:
    if not records:
        return {"n": 0}
    size = np.abs([difference(one) for one in records])
    reference = np.array([one["reference"]["log_bayes_factor"] for one in records])
    engine = reference + np.array([difference(one) for one in records])
    done = np.isfinite(size)
    return {
        "n": len(records),
        "median": float(np.median(size[done])) if done.any() else None,
        "q95": float(np.quantile(size[done], 0.95)) if done.any() else None,
        "largest": float(size[done].max()) if done.any() else None,
        "beyond_1": int((size > 1.0).sum()),
        "beyond_3": int((size > FAR).sum()),
        "big": int((reference > BIG).sum()),
        "lost": int(((reference > BIG) & ((engine < 0.0) | ~done)).sum()),
        "failed": int((~done).sum()),
        "reference_error": float(np.median([one["reference"]["error"] for one in records])),
        "reference_seconds": float(np.median([one["reference"]["seconds"] for one in records])),
        "engine_seconds": float(np.median([one["engine"]["seconds"] for one in records])),
    }


def table(found: dict[str, Any]) -> str:
    """The summary as a table."""
    lines = ["| part | pairs | median | 95 % | largest | > 1 | > 3 | reference > 10 | lost | failed |"]
    lines.append("| --- " * 10 + "|")
    rows = {"all": found["all"]}
    rows |= {f"{name}: {value}": part for name in PARTS for value, part in found[name].items()}
    for name, part in rows.items():
        if not part["n"] or part["median"] is None:
            continue
        numbers = " | ".join(f"{part[key]:.2f}" for key in ("median", "q95", "largest"))
        counts = " | ".join(str(part[key]) for key in ("beyond_1", "beyond_3", "big", "lost", "failed"))
        lines.append(f"| {name} | {part['n']} | {numbers} | {counts} |")
    return "\n".join(lines) + "\n"
