"""Mechanisms of one shape that are added to a law, their strengths free."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from skred.diagnosis.evidence.coefficient import Curve
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
    """

    name: str
    mechanism: Mechanism
    shape: Shape
    direction: Direction

    @property
    def parameter(self) -> Parameter:
        """As a free random variable."""
        strength = self.mechanism.strength
        return Parameter(self.name, strength.symbol, strength.unit, strength.paper_symbol)

    @property
    def scale(self) -> float:
        """Scale of the prior: half-normal, or normal where either sign may be."""
        assert self.mechanism.added is not None
        return self.mechanism.added.scale_of(self.shape)


def added_strengths(curves: Sequence[Curve]) -> tuple[AddedStrength, ...]:
    """Of some curves, numbered where two have the same name."""
    count: Counter[str] = Counter()
    added = []
    for curve in curves:
        name = curve.mechanism.strength.name
        count[name] += 1
        own = name if count[name] == 1 else f"{name}_{count[name]}"
        added.append(AddedStrength(own, curve.mechanism, curve.shape, curve.direction))
    return tuple(added)
