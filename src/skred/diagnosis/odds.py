"""Prior odds and what becomes of them: the rule of the campaign format, in one place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from skred.physics.mechanisms.spec import Group, Mechanism

NOTHING, UNLISTED = "nothing", "unlisted"
SHARES = {NOTHING: 0.5, Group.PHYSICS: 0.35, Group.INSTRUMENT: 0.1, UNLISTED: 0.05}
"""Prior probability of each group, shared equally by its members."""

_LEAST = 1e-12


@dataclass(frozen=True)
class Calibration:
    """What trials say of the odds of a force that is in no list against the listed ones.

    Attributes
    ----------
    offset, power : float
        Calibrated log odds are the offset plus the power times those stated by the evidence.
    """

    offset: float
    power: float

    @staticmethod
    def log_odds(plain: Mapping[str, float]) -> float:
        """Log odds of the unlisted force against all that is listed, as evidence and prior have them."""
        return math.log(max(plain[UNLISTED], _LEAST)) - math.log(max(_listed(plain), _LEAST))

    def of(self, plain: Mapping[str, float]) -> dict[str, float]:
        """Calibrated probabilities; that of nothing stays, and so do the odds between listed ids."""
        something, listed = 1.0 - plain[NOTHING], _listed(plain)
        if listed <= 0.0:
            return dict(plain)
        unlisted = something / (1.0 + math.exp(-self.offset - self.power * self.log_odds(plain)))
        found = {name: share / listed * (something - unlisted) for name, share in plain.items()}
        return found | {NOTHING: plain[NOTHING], UNLISTED: unlisted}


def _listed(probability: Mapping[str, float]) -> float:
    """Probability of all that is listed, faults of instruments too."""
    return math.fsum(share for name, share in probability.items() if name not in (NOTHING, UNLISTED))


def prior_odds(raced: Iterable[Mechanism]) -> dict[str, float]:
    """Prior probability of each id, `nothing` and `unlisted` included.

    A group without members gives its share to none: the rest is what it is relative to each other.
    """
    raced = list(raced)
    odds = {NOTHING: SHARES[NOTHING], UNLISTED: SHARES[UNLISTED]}
    for group in Group:
        members = [mechanism.id for mechanism in raced if mechanism.group is group]
        odds |= {name: SHARES[group] / len(members) for name in members}
    total = sum(odds.values())
    return {name: share / total for name, share in odds.items()}


def probabilities(log_factors: Mapping[str, float], odds: Mapping[str, float]) -> dict[str, float]:
    """Posterior probabilities from log Bayes factors against nothing; `nothing` itself is 0."""
    logs = {name: math.log(odds[name]) + log_factors.get(name, 0.0) for name in odds}
    most = max(logs.values())
    weights = {name: math.exp(max(value - most, -700.0)) for name, value in logs.items()}
    total = float(np.sum(list(weights.values())))
    return {name: weight / total for name, weight in weights.items()}
