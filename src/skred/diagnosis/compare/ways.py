"""Ways in which avalanches may differ in a mechanism's strength, at the shapes where they were looked at."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.tabulated.between_evidence import Way
from skred.inference.between_events import PRIOR, BetweenEvents

Ways = Mapping[BetweenEvents, Way]
"""Each way in which avalanches differ in a mechanism's strength."""


def gains_of(ways: Ways, in_common: float) -> dict[BetweenEvents, float]:
    """What each way has more than the strength in common, in nats; minus infinity for one that is not known.

    Parameters
    ----------
    in_common : float
        Log Bayes factor of that against nothing, at the same shape by strengths of one sign as the ways are.
    """
    gains = dict.fromkeys(BetweenEvents, -math.inf) | {BetweenEvents.COMMON: 0.0}
    return gains | {kind: way.log_factor - in_common for kind, way in ways.items()}


def over_ways(gains: Mapping[BetweenEvents, float]) -> float:
    """What all ways together have more than the strength in common, in nats, with their prior probability."""
    return float(np.logaddexp.reduce([math.log(PRIOR[kind]) + gain for kind, gain in gains.items()]))


@dataclass(frozen=True, eq=False)
class Looked:
    """A shape at which avalanches may differ in the strength, for all of its kind (`all_but_place`).

    Attributes
    ----------
    curve : Curve
    log_share : float
        Log of the posterior probability of these shapes with a strength in common, relative to all shapes.
    in_common : float
        Log Bayes factor of that at the shape, against nothing, by strengths of one sign as the ways are.
    ways : mapping of BetweenEvents to Way
        Empty where none could be computed.
    error : float or None
        Standard error of the log Bayes factor, in nats; None where it is not by many quadrature points yet.
    """

    curve: Curve
    log_share: float
    in_common: float
    ways: Ways
    error: float | None = None

    @property
    def gains(self) -> dict[BetweenEvents, float]:
        """What each way has more than the strength in common at this shape, in nats."""
        return gains_of(self.ways, self.in_common)

    @property
    def height(self) -> float:
        """Log of the posterior probability, strengths in common or not; not normalised."""
        return self.log_share + over_ways(self.gains)


def gains_over(looked: Sequence[Looked]) -> dict[BetweenEvents, float]:
    """What each way has more than the strength in common, over all shapes looked at, in nats."""
    shares = np.array([one.log_share for one in looked])
    shares -= np.logaddexp.reduce(shares)
    each = [one.gains for one in looked]
    return {kind: float(np.logaddexp.reduce(shares + [one[kind] for one in each])) for kind in each[0]}
