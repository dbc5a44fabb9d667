"""What avalanches left out say of what was added: what got better by it, and what worse."""

from __future__ import annotations

from typing import Any

from skred.diagnosis.words import error_texts
from skred.inference.intervals import PRACTICAL_DIFFERENCE
from skred.units import unit_text

_ERRORS = (("rmse_velocity", "speeds", "m s-1"), ("rmse_runout", "runouts", "m"))
"""Keys of ``held_out``, what they are errors of, unit."""


def improvement(document: dict[str, Any]) -> str:
    """How the log score and the errors of avalanches left out change; empty where nothing was added."""
    difference, se = (document["evidence"][key] for key in ("elpd_diff", "elpd_se"))
    if difference is None:
        return ""
    doubled = f"(twice its standard error: {2.0 * se:.1f})"
    counts = abs(difference) >= max(PRACTICAL_DIFFERENCE, 2.0 * se)
    if not counts:
        small = abs(difference) < PRACTICAL_DIFFERENCE
        why = "no practical difference" if small else "not beyond its error"
        score = f"the log score changes by {difference:+.1f} {doubled}, {why}"
    else:
        way = "rises" if difference > 0.0 else "falls"
        score = f"the log score {way} by {abs(difference):.1f} {doubled}"
    better, worse = _changes(document["held_out"])
    gained, lost = [score, *better], worse
    if counts and difference < 0.0:
        gained, lost = better, [score, *worse]
    if not gained:
        return f"Avalanches left out are predicted worse: {'; '.join(lost)}."
    text = f"For avalanches left out {'; '.join(gained)}."
    return f"{text} But {'; '.join(lost)}." if lost else text


def _changes(held: dict[str, Any]) -> tuple[list[str], list[str]]:
    """Errors that fall or stay as they are, and errors that grow, as they are written."""
    better, worse = list[str](), list[str]()
    for key, what, unit in _ERRORS:
        values = [held[f"{key}_{when}"] for when in ("before", "after")]
        if None in values:
            continue
        before, after = error_texts(values, unit)
        shown = unit_text(unit)
        if before == after:
            better.append(f"the error of {what} stays at {before} {shown}")
        elif values[1] < values[0]:
            better.append(f"the error of {what} falls from {before} to {after} {shown}")
        else:
            worse.append(f"the error of {what} grows from {before} to {after} {shown}")
    return better, worse
