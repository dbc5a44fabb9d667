"""A friction law: a sum of mechanisms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skred.physics.mechanisms.spec import Mechanism


@dataclass(frozen=True)
class Law:
    """A friction law of the pack.

    Attributes
    ----------
    id, title : str
        Short name (command line, files) and name in plain words.
    mechanisms : tuple of Mechanism
        Its summands, in the order of the kernel's strengths.
    build : callable
        ``build(problem) -> pymc.Model``, see `skred.inference.pooled.PooledProblem`.
    reference : str
        Where the law comes from.
    parameters : tuple of (name, symbol, unit)
        The free random variables of its model.
    """

    id: str
    title: str
    mechanisms: tuple[Mechanism, ...]
    build: Callable[[Any], Any]
    reference: str
    parameters: tuple[tuple[str, str, str], ...]

    @property
    def equation(self) -> str:
        """Its equation of motion."""
        terms = " ".join(mechanism.equation for mechanism in self.mechanisms)
        return f"dU^2/(2 ds) = g sin(phi) {terms}"
