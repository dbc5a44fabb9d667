"""How probabilities become a verdict: the rule of the campaign format, and ties across groups."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from skred.diagnosis.evidence.prior_odds import NOTHING, SHARES, UNLISTED, same_term
from skred.diagnosis.limits import LIMIT, NOTHING_AT_MOST
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group

TIED_NATS = 2.0
"""An id of another group is tied with the named one where its log probability is at most so far below. Some
such ties no recordings split: a low dam and a bias of the sensor beside it. Which group leads decides the
verdict, not whether its name stands alone."""


@dataclass(frozen=True)
class Decision:
    """What the probabilities say.

    Attributes
    ----------
    verdict : str
        As in the campaign format.
    names : tuple of str
        One is named, several are tied, none where nothing is. Those of the leading group come first, each
        group's most probable first; `unlisted` may be among the tied ones, and never comes first. What is the
        same term by another name follows each.
    beside : tuple of str
        Listed ids that are tied with a force in no list, where that is the answer.
    """

    verdict: str
    names: tuple[str, ...]
    beside: tuple[str, ...] = ()

    @property
    def tied(self) -> tuple[str, ...]:
        """What these recordings cannot tell from the answer."""
        return self.names[1:] or self.beside

    @property
    def answer(self) -> str | None:
        """Id of what the verdict names first, or of a force in no list; None where nothing is claimed."""
        return UNLISTED if self.verdict == "unexplained" else next(iter(self.names), None)

    @property
    def disputed(self) -> bool:
        """Whether physics, in the list or not, and instruments are tied: either may be off."""
        faults = [name != UNLISTED and mechanisms()[name].group == Group.INSTRUMENT for name in self.names]
        return any(faults) and not all(faults)


def alarmed(probability: Mapping[str, float], p_value: float) -> bool:
    """Whether something is wrong: hardly any clean campaign has such odds, and nothing is not probable."""
    return p_value <= LIMIT and probability[NOTHING] < NOTHING_AT_MOST


def decide(probability: Mapping[str, float], p_value: float, can_tell: bool) -> Decision:
    """Verdict from probabilities.

    Parameters
    ----------
    probability : mapping
        Of each id.
    p_value : float
        Of the odds that the probabilities are.
    can_tell : bool
        Whether relevant strengths would mostly have been found.

    Returns
    -------
    Decision
        Without an alarm `nothing_missing`, if relevant strengths would have been found, clean campaigns look
        alike and nothing is not less probable than its prior; else `cannot_tell`.
    """
    if not alarmed(probability, p_value):
        nothing = can_tell and p_value > LIMIT and probability[NOTHING] >= SHARES[NOTHING]
        return Decision("nothing_missing" if nothing else "cannot_tell", ())
    return blamed(probability)


def blamed(probability: Mapping[str, float]) -> Decision:
    """What is off, if something is: the credible set of the leading group, and what is tied with its name."""
    groups: dict[str, dict[str, float]] = {UNLISTED: {UNLISTED: probability[UNLISTED]}}
    for name, share in probability.items():
        if name not in (NOTHING, UNLISTED):
            groups.setdefault(mechanisms()[name].group, {})[name] = share
    leading = max(groups, key=lambda group: sum(groups[group].values()))
    others = {name: share for group in groups if group != leading for name, share in groups[group].items()}
    if leading == UNLISTED:
        return Decision("unexplained", (), _with_other_names(_within(others, probability[UNLISTED])))
    verdict = "missing_physics" if leading == Group.PHYSICS else "instrument"
    names = smallest_set(groups[leading])
    return Decision(verdict, _with_other_names((*names, *_within(others, probability[names[0]]))))


def _within(shares: Mapping[str, float], leading: float) -> tuple[str, ...]:
    """Ids whose probability is close to that of the named one, most probable first."""
    close = [name for name, share in shares.items() if share >= math.exp(-TIED_NATS) * leading]
    return tuple(sorted(close, key=lambda name: -shares[name]))


def _with_other_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Each id, and after it those that are the same term by another name and are not told already."""
    found: list[str] = []
    for name in names:
        found += [name, *(one.id for one in same_term(name) if one.id not in names)]
    return tuple(found)


def smallest_set(shares: Mapping[str, float]) -> tuple[str, ...]:
    """The smallest set of ids that holds 0.9 of their group, most probable first."""
    total, held, names = sum(shares.values()), 0.0, []
    for name in sorted(shares, key=lambda name: -shares[name]):
        names.append(name)
        held += shares[name]
        if held >= INTERVAL_PROBABILITY * total:
            break
    return tuple(names)
