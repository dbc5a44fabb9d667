"""Mechanisms of one shape that are added to a law, their strengths free."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skred.diagnosis.evidence.coefficient import Curve
from skred.inference.between_events import BetweenEvents, symbolic_components, variable
from skred.physics.law import Parameter
from skred.physics.mechanisms.spec import Direction, Mechanism, Shape


@dataclass(frozen=True, eq=False)
class AddedStrength:
    """A mechanism of one shape that is added, its strength free.

    Attributes
    ----------
    name : str
        Of the parameter: the strength's own, numbered if two of a kind are added.
    mechanism : Mechanism
    shape : Shape
    direction : Direction
    between : BetweenEvents
        How it differs between avalanches.
    """

    name: str
    mechanism: Mechanism
    shape: Shape
    direction: Direction
    between: BetweenEvents = BetweenEvents.COMMON

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its free random variables: the strength, and how it differs between avalanches."""
        strength = self.mechanism.strength
        own = Parameter(self.name, strength.symbol, strength.unit, strength.paper_symbol)
        if self.between is BetweenEvents.COMMON:
            return (own,)
        symbol = {"spread": f"sd(log {strength.symbol})", "some": f"share({strength.symbol})"}[self.between]
        return own, Parameter(self.between_name, symbol, "1")

    @property
    def between_name(self) -> str:
        """Of the parameter that says how it differs between avalanches; empty where it does not."""
        ends = self.between.parameter
        return f"{self.name}_{ends}" if ends else ""

    def symbolic(self, strength: Any) -> tuple[Any, Any]:
        """Strengths that avalanches have and log shares of them, in the current PyMC model: two vectors."""
        return symbolic_components(self.between, strength, variable(self.between, self.between_name))

    @property
    def scale(self) -> float:
        """Scale of the prior: half-normal, or normal where either sign may be."""
        assert self.mechanism.added is not None
        return self.mechanism.added.scale_of(self.shape)


def added_strengths(curves: Sequence[Curve], way: BetweenEvents) -> tuple[AddedStrength, ...]:
    """Of some curves, in which avalanches differ alike; numbered where two have the same name."""
    count: Counter[str] = Counter()
    added = []
    for curve in curves:
        name = curve.mechanism.strength.name
        count[name] += 1
        own = name if count[name] == 1 else f"{name}_{count[name]}"
        added.append(AddedStrength(own, curve.mechanism, curve.shape, curve.direction, way))
    return tuple(added)
