"""Arguments of the functions, checked as the options of the commands are: the message names the argument."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from skred.errors import InputError

MOST_DRAWS, MOST_CHAINS, SEEDS, LONGEST_SMOOTHING_M = 1_000_000, 100, 2**31, 1000.0
LIKELIHOODS, SAMPLERS = ("pooled", "hierarchical"), ("metropolis", "nuts", "smc")


def _refuse(name: str, expected: str, found: Any) -> InputError:
    return InputError(f"{name}: expected {expected}, found {found!r:.60}")


def whole(name: str, value: Any, low: int, high: int) -> int:
    """A whole number within limits."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or not low <= int(value) <= high:
        raise _refuse(name, f"a whole number from {low} to {high}", value)
    return int(value)


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number within limits."""
    try:
        found = math.nan if isinstance(value, (bool, str, bytes)) else float(value)
    except (TypeError, ValueError):
        found = math.nan
    if not (math.isfinite(found) and low <= found <= high):
        limits = "" if math.isinf(high) else f" from {low:g} to {high:g}"
        raise _refuse(name, f"a number{limits}", value)
    return found


def one_of(name: str, value: Any, choices: Sequence[str]) -> None:
    """One of some words."""
    if not isinstance(value, str) or value not in choices:
        raise _refuse(name, f"one of {', '.join(choices)}", value)


def numbers(name: str, values: Any, count: int | None = None) -> tuple[float, ...]:
    """Several finite numbers, or just so many."""
    some = "numbers" if count is None else f"{count} numbers"
    if isinstance(values, (str, bytes, Mapping)) or not hasattr(values, "__iter__"):
        raise _refuse(name, some, values)
    found = tuple(number(name, value) for value in values)
    if count is not None and len(found) != count:
        raise _refuse(name, some, values)
    return found


def mapping(name: str, value: Any, what: str) -> Mapping[str, Any]:
    """A mapping from texts; None for an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise _refuse(name, f"a mapping from {what}", value)
    return value


def smoothing(value: Any) -> None:
    """A smoothing length, or None."""
    if value is not None:
        number("smoothing_m", value, 0.0, LONGEST_SMOOTHING_M)


def sampling(draws: Any, tune: Any, chains: Any, seed: Any, sampler: Any = "metropolis") -> None:
    """Settings of a sampler."""
    whole("draws", draws, 4, MOST_DRAWS)
    if tune is not None:
        whole("tune", tune, 1, MOST_DRAWS)
    whole("chains", chains, 2, MOST_CHAINS)
    whole("seed", seed, 0, SEEDS - 1)
    one_of("sampler", sampler, SAMPLERS)
