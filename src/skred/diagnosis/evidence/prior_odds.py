"""Prior odds and what becomes of them: the rule of the campaign format, in one place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group, Mechanism

NOTHING, UNLISTED = "nothing", "unlisted"
SHARES = {NOTHING: 0.5, Group.PHYSICS: 0.35, Group.INSTRUMENT: 0.1, UNLISTED: 0.05}
"""Prior probability of each group, shared equally by its members."""

CALIBRATION_VERSION = 2
"""Of how evidence becomes probability; it changes with `prior_odds` and `POWER`."""
POWER = 0.75
"""Tempering exponent of Bayes factors between whatever may be missing. Every model is wrong in edges and
exponents, and evidence says more for the less wrong one than trials bear out. Frozen from opened trials, by
``studies/thresholds/calibrate_odds.py``, before those that claims are made from."""


def prior_odds(compared: Iterable[Mechanism]) -> dict[str, float]:
    """Prior probability of each id, `nothing` and `unlisted` included.

    A group without members gives its share to none: the rest is what it is relative to each other. What is
    the same term as another by another name gives its share to that one; half of it if it is also compared
    itself, in shapes of its own.
    """
    own = {mechanism.id: mechanism for mechanism in compared}
    named = own | {one.id: one for name in own for one in same_term(name)}
    odds = {NOTHING: SHARES[NOTHING], UNLISTED: SHARES[UNLISTED]} | dict.fromkeys(own, 0.0)
    for group in Group:
        members = [mechanism for mechanism in named.values() if mechanism.group is group]
        for one in members:
            share = SHARES[group] / len(members)
            given = 0.0 if one.same_term_as not in own else 0.5 if one.id in own else 1.0
            if given:
                odds[one.same_term_as] += given * share
            if one.id in own:
                odds[one.id] += (1.0 - given) * share
    total = sum(odds.values())
    return {name: share / total for name, share in odds.items()}


def same_term(name: str) -> list[Mechanism]:
    """Mechanisms that are the same term as one, by another name."""
    return [one for one in mechanisms().values() if one.same_term_as == name]


def probabilities(log_factors: Mapping[str, float], odds: Mapping[str, float]) -> dict[str, float]:
    """Posterior probabilities from log Bayes factors against nothing; `nothing` itself is 0."""
    logs = {name: math.log(odds[name]) + log_factors.get(name, 0.0) for name in odds}
    most = max(logs.values())
    weights = {name: math.exp(max(value - most, -700.0)) for name, value in logs.items()}
    total = float(np.sum(list(weights.values())))
    return {name: weight / total for name, weight in weights.items()}


def log_odds(log_factors: Mapping[str, float], odds: Mapping[str, float]) -> float:
    """Log posterior odds of anything against nothing, from log Bayes factors against nothing."""
    logs = [math.log(odds[name]) + log_factors.get(name, 0.0) for name in odds if name != NOTHING]
    return float(np.logaddexp.reduce(logs)) - math.log(odds[NOTHING])


def stated(
    log_factors: Mapping[str, float], odds: Mapping[str, float], power: float = POWER
) -> dict[str, float]:
    """Probabilities with tempered Bayes factors among all but nothing, which keeps its own."""
    nothing = probabilities(log_factors, odds)[NOTHING]
    among = probabilities({name: power * value for name, value in log_factors.items()}, odds)
    something = math.fsum(share for name, share in among.items() if name != NOTHING)
    rest = {name: share / something * (1.0 - nothing) for name, share in among.items()}
    return rest | {NOTHING: nothing}
