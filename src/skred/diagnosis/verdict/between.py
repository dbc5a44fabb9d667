"""How avalanches differ in what was added: the most probable way, and what each avalanche has."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.diagnosis.augment.added_strength import AddedStrength
from skred.diagnosis.augment.coefficient import augmented_of, multiples_of_events, some_draws
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.words import MOST_NAMED, TOLD_FROM, percent
from skred.inference.between_events import BetweenEvents
from skred.inference.calibrate import Calibration
from skred.inference.influence_words import enumerated


def ways_document(candidate: Candidate) -> dict[str, float]:
    """Probability of each way in which avalanches may differ in a mechanism's strength."""
    return {str(kind): share for kind, share in candidate.between.items()}


def between_document(calibration: Calibration, added: AddedStrength, candidate: Candidate) -> dict[str, Any]:
    """How avalanches differ in one strength, as it was calibrated.

    Keys
    ----
    between_events : ``common``, ``spread`` or ``some``
    ways : probability of each of these
    spread : mean and sd of the sd of log strengths; share : of the share that have it; null where not so
    events : for each avalanche its probability of having it, or its multiple of the median; null in common
    """
    name = added.between_name
    draws = some_draws(calibration)[name] if name else np.zeros(1)
    parameter = {"mean": float(draws.mean()), "sd": float(draws.std())}
    return {
        "between_events": str(added.between),
        "ways": ways_document(candidate),
        "spread": parameter if added.between is BetweenEvents.SPREAD else None,
        "share": parameter if added.between is BetweenEvents.SOME else None,
        "events": _events(calibration, added) if name else None,
    }


def _events(calibration: Calibration, added: AddedStrength) -> list[dict[str, Any]]:
    problem = augmented_of(calibration)
    key = "probability" if added.between is BetweenEvents.SOME else "multiple"
    multiples = multiples_of_events(calibration)
    assert multiples is not None
    own = multiples[:, problem.added.index(added)]
    return [
        {"event": event, key: float(value)}
        for event, value in zip(problem.campaign.event_ids, own, strict=True)
    ]


def _in_which_ways(ways: dict[str, float], added: str) -> str:
    """By degree, or in that some have none: both with their probabilities, unless one is improbable."""
    said = {BetweenEvents.SPREAD: "by degree", BetweenEvents.SOME: "some have none of it"}
    likely = {kind: words for kind, words in said.items() if kind == added or ways[kind] >= TOLD_FROM}
    if len(likely) == 1:
        return next(iter(likely.values()))
    return ", or ".join(f"{words} ({percent(ways[kind])})" for kind, words in likely.items())


def between_sentence(strength: dict[str, Any]) -> str:
    """How avalanches differ in it, in plain words; empty where they do not."""
    way, ways = strength["between_events"], strength["ways"]
    likely = 1.0 - ways[BetweenEvents.COMMON]
    if way == BetweenEvents.COMMON:
        if likely < 0.5:
            return ""
        return (
            f"Avalanches probably differ in it ({percent(likely)}); no law in which they do was calibrated."
        )
    differs = f"Avalanches differ in it with a probability of {percent(likely)}: {_in_which_ways(ways, way)}."
    if way == BetweenEvents.SPREAD:
        spread = strength["spread"]
        factor = float(np.exp(spread["mean"]))
        return (
            f"{differs} By degree, the strength is their median, and two of three are within a factor of"
            f" {factor:.1f} of it (sd of the logarithm {spread['mean']:.2f} ± {spread['sd']:.2f})."
        )
    share = strength["share"]
    having = [one["event"] for one in strength["events"] if one["probability"] > 0.5]
    who = f": more probably than not {enumerated(having)}" if 0 < len(having) <= MOST_NAMED else ""
    return f"{differs} If some have none, a share of {share['mean']:.2f} ± {share['sd']:.2f} has it{who}."
