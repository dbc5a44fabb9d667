"""Arguments of the functions, checked as the options of the commands are: the message names the argument."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from operator import index
from typing import Any

from skred.errors import InputError

MOST_DRAWS, MOST_CHAINS, SEEDS, LONGEST_SMOOTHING_M = 1_000_000, 100, 2**31, 1000.0
LIKELIHOODS, SAMPLERS = ("pooled", "hierarchical"), ("metropolis", "nuts", "smc")

_NAMES = {
    "--likelihood hierarchical": "likelihood='hierarchical'",
    "--sampler metropolis": "sampler='metropolis'",
    "--force": "force=True",
    "--speed": "speeds_m_s",
    "--pressure": "pressures_kpa",
    "--density": "density_kg_m3",
    "--return-period": "return_periods_years",
    "--release": "release_s_m",
    "--smoothing": "smoothing_m",
    "--from": "from_folder",
    "--base-model": "law",
    "--models": "laws",
    "--out": "path",
} | {
    f"--{name.replace('_', '-')}": name
    for name in (
        *("likelihood", "errors", "priors", "sampler", "draws", "tune", "chains", "seed", "exact_loo"),
        *("at", "drag_coefficient", "per_year", "track", "lock", "outer_folds", "max_mechanisms", "quick"),
    )
}
"""What the options of the commands are called here."""
_OPTION = re.compile(rf"(?<![\w/-])(?:{'|'.join(sorted(_NAMES, key=len, reverse=True))})(?![\w/-])")


def told_by_name[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """Let what is refused further down, in the words of the command line, be told by the arguments' names."""

    @wraps(function)
    def told(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except InputError as error:
            if len(error.args) == 1:
                error.args = (_OPTION.sub(lambda option: _NAMES[option[0]], str(error)),)
            raise

    return told


def _refuse(name: str, expected: str, found: Any) -> InputError:
    return InputError(f"{name}: expected {expected}, found {_shown(found)}")


def _shown(value: Any) -> str:
    """Any value, cut; a whole number of thousands of digits has no text."""
    try:
        return f"{value!r:.60}"
    except ValueError:
        return f"a value of type {type(value).__name__}"


def _plain(value: Any) -> Any:
    """The number in an array without axes, as NumPy's scalars are; anything else as it is."""
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def is_several(value: Any) -> bool:
    """Whether a value can be gone through: an array without axes only looks like it."""
    return hasattr(value, "__iter__") and getattr(value, "ndim", 1) > 0


def whole(name: str, value: Any, low: int, high: int) -> int:
    """A whole number within limits."""
    plain = _plain(value)
    try:
        found = None if isinstance(plain, bool) else index(plain)
    except TypeError:
        found = None
    if found is None or not low <= found <= high:
        raise _refuse(name, f"a whole number from {low} to {high}", value)
    return found


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number within limits."""
    plain = _plain(value)
    is_no_number = isinstance(plain, (bool, str, bytes)) or hasattr(plain, "__iter__")
    try:
        found = math.nan if is_no_number else float(plain)
    except (TypeError, ValueError, OverflowError):
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
    if isinstance(values, (str, bytes, Mapping)) or not is_several(values):
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


def smoothing(value: Any) -> float | None:
    """A smoothing length, or None."""
    return None if value is None else number("smoothing_m", value, 0.0, LONGEST_SMOOTHING_M)


def scales(priors: Any) -> dict[str, float]:
    """Scales of priors by name of parameter, as plain numbers; the laws say which there are."""
    given = mapping("priors", priors, "parameters to scales")
    return {name: number(f"priors[{name!r:.60}]", scale) for name, scale in given.items()}


def sampling(draws: Any, tune: Any, chains: Any, seed: Any, sampler: Any = "metropolis") -> None:
    """Settings of a sampler."""
    whole("draws", draws, 4, MOST_DRAWS)
    if tune is not None:
        whole("tune", tune, 1, MOST_DRAWS)
    whole("chains", chains, 2, MOST_CHAINS)
    whole("seed", seed, 0, SEEDS - 1)
    one_of("sampler", sampler, SAMPLERS)
