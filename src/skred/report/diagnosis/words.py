"""Words and colours of a diagnosis that its figures, tables and page share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group
from skred.report.shared.labels import unit_text
from skred.report.shared.style import GREY

if TYPE_CHECKING:
    from skred.diagnosis.compare.candidate import Candidate
    from skred.diagnosis.compare.comparison import Comparison
    from skred.diagnosis.compare.location import Location
    from skred.report.diagnosis.flat import Flat as Diagnosis

FloatArray = NDArray[np.float64]
BEFORE, AFTER, MISMATCH = GREY, "#0072B2", "#D55E00"
"""Predictions by the base law and by the augmented one; the place where something is missing."""
_COLOURS = {Group.PHYSICS: "#0072B2", Group.INSTRUMENT: "#CC79A7", UNLISTED: "#E69F00", NOTHING: GREY}
_KINDS = {
    Group.PHYSICS: "listed physics", Group.INSTRUMENT: "instrument", UNLISTED: "unlisted",
    NOTHING: "nothing",
}  # fmt: skip
_VERDICTS = {
    "missing_physics": "Physics is missing",
    "nothing_missing": "Nothing is missing",
    "instrument": "The recordings are off, not the physics",
    "unexplained": "Something is missing that is not in the list",
    "cannot_tell": "These recordings cannot tell",
}


def verdict_words(found: Diagnosis) -> str:
    """The verdict in a few words."""
    if found.decision.disputed:
        return "Physics is missing, or the recordings are off"
    return _VERDICTS[found.decision.verdict]


def title_of(name: str) -> str:
    """A raced id in plain words."""
    if name == NOTHING:
        return "nothing missing"
    if name == UNLISTED:
        return "a force that is not in the list"
    mechanism = mechanisms().get(name)
    return mechanism.title if mechanism is not None else name


def short_title(name: str) -> str:
    """The same without the examples after its colon."""
    return title_of(name).partition(":")[0]


def kind_of(name: str) -> str:
    """What an id blames, in words."""
    return _KINDS[_group(name)]


def colour_of(name: str) -> str:
    """One colour for each group of ids."""
    return _COLOURS[_group(name)]


def kinds() -> list[tuple[str, str]]:
    """Words and colour of each group."""
    return [(_KINDS[group], colour) for group, colour in _COLOURS.items()]


def _group(name: str) -> str:
    if name in (NOTHING, UNLISTED):
        return name
    mechanism = mechanisms().get(name)
    return mechanism.group if mechanism is not None else UNLISTED


def bracketed(unit: str) -> str:
    """A unit in brackets for an axis; nothing where there is none."""
    return "" if unit == "1" else f" [{unit_text(unit)}]"


def leading_name(comparison: Comparison) -> str:
    """The most probable listed id."""
    shares = {
        name: share for name, share in comparison.probability.items() if name not in (NOTHING, UNLISTED)
    }
    return max(shares, key=lambda name: shares[name])


def leading(comparison: Comparison, name: str = "") -> Candidate:
    """A candidate, by default the most probable listed one, where its evidence is highest."""
    chosen = name or leading_name(comparison)
    return comparison.leading(chosen).candidates[chosen]


def comparisons(found: Diagnosis) -> list[Comparison]:
    """The comparisons that were run and looked at, each once."""
    first = [found.comparison] if found.comparison is not None else []
    return first + [step.comparison for step in found.steps[1:]]


def factor_at(candidate: Candidate, relative: float) -> float:
    """Log Bayes factor of an candidate with its prior's scale multiplied."""
    added = candidate.mechanism.added
    assert added is not None
    factors = [one.log_bayes_factor_at(relative * added.scale_of(one.shape)) for one in candidate.curves]
    return float(logsumexp(candidate.log_weights + np.array(factors)))


def profile_of(found: Diagnosis) -> Location | None:
    """The missing force along the track; where there is no alarm, that in which nothing stands out."""
    return found.location or found.quiet


def stretch_of(found: Diagnosis) -> tuple[float, float] | None:
    """Where the verdict says that something acts [m]."""
    if found.steps:
        return found.steps[0].candidate.stretch()
    if found.decision.verdict == "unexplained" and found.location is not None:
        return found.location.stretch_m
    return None


def blamed_sensors(found: Diagnosis) -> set[str]:
    """Sensors that the verdict blames."""
    return {step.candidate.best.shape.sensor or "" for step in found.steps} - {""}
