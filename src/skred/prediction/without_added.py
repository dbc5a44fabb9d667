"""The same prediction by the base law: what of the numbers hangs on what a diagnosis added."""

from __future__ import annotations

import json
from typing import Any

import xarray as xr

from skred.chances import digits
from skred.prediction.bands import runouts_exceeded_by
from skred.prediction.source import Source
from skred.prediction.terms import added_rows
from skred.prediction.track import PredictionTrack
from skred.prediction.words import chance, name_of, period, valued

SHARE = 0.1
"""Of all avalanches, which exceed the speed and the pressure that are compared."""


def without_added(source: Source, track: PredictionTrack, base: xr.Dataset | None) -> dict[str, Any] | None:
    """What the base law predicts, as plain data; None where nothing was added or nothing is to compare with.

    Parameters
    ----------
    source : Source
    track : PredictionTrack
    base : Dataset or None
        As `skred.prediction.predict.prediction_of` makes it.
    """
    if base is None or source.without is None:
        return None
    calibration = source.without.calibration
    problem = source.without.problem
    return {
        "file": source.without_file,
        "law": {"id": calibration.law.id, "title": calibration.law.title},
        "error_model": {"id": problem.error_model.id, "title": problem.error_model.title},
        "runout": {
            "exceeded_by": runouts_exceeded_by(base, track),
            "does_not_start": float(base.attrs["share_that_does_not_start"]),
        },
        "at": json.loads(base.attrs["at"]),
        "meaning": _meaning(left_out=not any(row["used"] for row in added_rows(source.stored.added, track))),
    }


def comparison_sentences(document: dict[str, Any]) -> list[str]:
    """Both predictions at each place, and what their difference means.

    Parameters
    ----------
    document : dict
        The content of ``prediction.json``.
    """
    other = document["without_added"]
    if other is None:
        return []
    first = (
        f"For comparison the base law, fitted to the same recordings without what was added"
        f" ({other['file']}; same releases, same seed)."
    )
    pairs = zip(document["at"], other["at"], strict=True)
    told = [_at(here, base) for here, base in pairs] or [_runouts(document, other)]
    return [first, *told, other["meaning"]]


def _meaning(*, left_out: bool) -> str:
    """What the difference between both predictions means."""
    if left_out:
        return (
            "What was added is left out here, but the coefficients used here were fitted beside it. Those of"
            " the base law were fitted to the same recordings without it. The difference between both is what"
            " hangs on the added term."
        )
    return "The difference between both is what hangs on what was added."


def _at(here: dict[str, Any], base: dict[str, Any]) -> str:
    """One place by both laws."""
    told = [f"{chance(here['reached'])} reach it, by the base law {chance(base['reached'])}"]
    periods = [row["reached"].get("return_period_years") for row in (here, base)]
    if all(periods):
        told.append(f"one comes every {period(periods[0])} years, by the base law {period(periods[1])}")
    for name, words in (("speed", "are faster than"), ("pressure", "press with more than")):
        rows = [_exceeded(row, name) for row in (here, base)]
        told.append(
            f"{100 * SHARE:g} % of all {words} {valued(rows[0])}, by the base law {valued(rows[1])}"
            f" {here[name]['unit']}"
        )
    return f"{name_of(here)}: {'; '.join(told)}."


def _exceeded(row: dict[str, Any], name: str) -> dict[str, Any]:
    return next(one for one in row[name]["exceeded_by"] if one["share"] == SHARE)


def _runouts(document: dict[str, Any], other: dict[str, Any]) -> str:
    """How far by both laws, where no place is named."""
    pairs = zip(document["runout"]["exceeded_by"], other["runout"]["exceeded_by"], strict=True)
    told = [
        f"{100 * here['share']:g} % run beyond s = {digits(here['value'], 4)} m, by the base law"
        f" {digits(base['value'], 4)} m"
        for here, base in pairs
    ]
    return f"{'; '.join(told)}."
