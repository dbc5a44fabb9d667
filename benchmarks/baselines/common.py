"""What every baseline returns, and how evidence, probabilities or a guess become a verdict.

What is tuned is tuned on development trials and frozen: ``python -m benchmarks.development_set`` with
``--n 30 --seed 5000``, ``--n 60 --seed 5100 --hidden nothing`` and ``--n 40 --seed 5200 --hidden listed``.
Limits of the alarm are apart for sparse and dense recordings, each the 95 % quantile of the scores of those
trials in which nothing is hidden (32 sparse, 36 dense; nasty ones left out). Temperatures give the best mean
log score.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign
from skred.diagnosis.check.decision import blamed
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED, prior_odds, probabilities, same_term
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group, Mechanism

FloatArray = NDArray[np.float64]
Stretch = tuple[float, float]
Verdict = Literal["missing_physics", "nothing_missing", "instrument", "unexplained"]
VERDICT_OF: dict[str, Verdict] = {Group.PHYSICS: "missing_physics", Group.INSTRUMENT: "instrument"}
_MOST_SPARSE_SENSORS = 10


@dataclass(frozen=True)
class Answer:
    """What a baseline says of a campaign.

    Attributes
    ----------
    verdict : str
        As in the campaign format; no baseline says `cannot_tell`.
    mechanism : str or None
        The id that it names.
    indistinguishable : tuple of str
        Others that it cannot tell from that one.
    probability : mapping or None
        Of each id, `nothing` and `unlisted` included; None where it has none.
    location : (float, float) or None
        From and to [m], where it is local.
    score : float
        How strongly it says that something is missing, in its own units.
    leading : str or None
        What it would name, were its limit lower: for comparisons at equal rates of false alarms.
    """

    verdict: Verdict
    mechanism: str | None
    indistinguishable: tuple[str, ...]
    probability: Mapping[str, float] | None
    location: Stretch | None
    score: float
    leading: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """The answer in the words of verdict.json; score and leading are further keys."""
        place = None
        if self.location is not None:
            place = {"s_from_m": self.location[0], "s_to_m": self.location[1]}
        return {
            "verdict": self.verdict,
            "mechanism": self.mechanism,
            "probability": {} if self.probability is None else dict(self.probability),
            "indistinguishable": list(self.indistinguishable),
            "location": place,
            "score": self.score,
            "leading": self.leading,
        }


class Baseline(Protocol):
    """A way to name missing physics."""

    id: str

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Say what the campaign lacks in the base law with this id."""


def is_dense(campaign: Campaign) -> bool:
    """Whether a campaign has profiles, not a few speeds."""
    return sum(not sensor.is_runout for sensor in campaign.sensors) > _MOST_SPARSE_SENSORS


def possible(base_law: str) -> dict[str, Mechanism]:
    """What the base law does not have already, by id."""
    base = tuple(mechanism.id for mechanism in load_law(base_law).mechanisms)
    return {
        name: one for name, one in mechanisms().items() if one.added is not None and one.added.joins(base)
    }


def group_of(name: str) -> str:
    """What an id blames; `nothing` and `unlisted` are groups of their own."""
    return name if name in (NOTHING, UNLISTED) else str(mechanisms()[name].group)


def weighed(
    factors: Mapping[str, float],
    base_law: str,
    limit: float,
    temperature: float,
    stretches: Mapping[str, Stretch | None],
) -> Answer:
    """Answer from log Bayes factors, by the campaign format's prior odds and its rule of groups.

    Parameters
    ----------
    factors : mapping
        Log Bayes factor of each candidate against nothing; perhaps of `unlisted`, which otherwise keeps its
        prior share of anything.
    limit : float
        Log odds of anything, above which it alarms.
    temperature : float
        Divides the log Bayes factors before they become probabilities; the alarm is by undivided ones.
    stretches : mapping
        Where each local id has most of its evidence.
    """
    compared = {name: value for name, value in factors.items() if name in possible(base_law)}
    odds = prior_odds([mechanisms()[name] for name in compared])
    if UNLISTED in factors:
        compared[UNLISTED] = factors[UNLISTED]
    else:
        listed = [odds[name] * np.exp(min(value, 600.0)) for name, value in compared.items()]
        compared[UNLISTED] = float(np.log(np.sum(listed) / sum(odds[name] for name in compared)))
    plain = probabilities({**compared, NOTHING: 0.0}, odds)
    score = float(np.log1p(-min(plain[NOTHING], 1.0 - 1e-15)) - np.log(max(plain[NOTHING], 1e-300)))
    tempered = {name: value / temperature for name, value in compared.items()}
    probability = probabilities({**tempered, NOTHING: 0.0}, odds)
    return decided(probability, score, limit, stretches)


def decided(
    probability: Mapping[str, float], score: float, limit: float, stretches: Mapping[str, Stretch | None]
) -> Answer:
    """Answer from probabilities, by the rule that a diagnosis has where something is off."""
    names = blamed(probability).names
    first = names[0] if names else UNLISTED
    if score <= limit:
        return Answer("nothing_missing", None, (), probability, None, score, first)
    stretch = stretches.get(first)
    if not names:
        return Answer("unexplained", None, (), probability, stretch, score, UNLISTED)
    return Answer(VERDICT_OF[group_of(first)], first, names[1:], probability, stretch, score, first)


def nearest(
    similarity: Mapping[str, float], base_law: str, score: float, limit: float, stretch: Stretch | None
) -> Answer:
    """Answer that names whatever is most similar, without probabilities.

    Parameters
    ----------
    similarity : mapping
        Of each id; the largest wins, and what is the same term by another name is tied.
    stretch : (float, float) or None
        Where.
    """
    compared = {name: value for name, value in similarity.items() if name in possible(base_law)}
    if score <= limit or not compared:
        leading = max(compared, key=lambda name: compared[name], default=None)
        return Answer("nothing_missing", None, (), None, None, score, leading)
    name = max(compared, key=lambda one: compared[one])
    tied = tuple(one.id for one in same_term(name))
    return Answer(VERDICT_OF[group_of(name)], name, tied, None, stretch, score, name)
