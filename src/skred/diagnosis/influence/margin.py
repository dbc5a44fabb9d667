"""By how many nats an answer is given, by all recordings and by parts of them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.influence.part import Part

MOST = 1.0 / 3.0
"""Share of the avalanches that an answer may hang on and be said to be carried by few: more is not few."""


@dataclass(frozen=True, eq=False)
class Change:
    """How the log Bayes factor of one id changes with what is left out.

    Both sides by the same, quicker method; only their difference is taken from it.

    Attributes
    ----------
    factor : callable
        Log Bayes factor by a part of the recordings.
    pool : ThreadPoolExecutor
    known : dict
        By what was left out.
    """

    factor: Callable[[Part], float]
    pool: ThreadPoolExecutor
    known: dict[bytes, float] = field(default_factory=dict)

    def without(self, parts: Sequence[Part]) -> FloatArray:
        """By parts of the recordings, less that by all of them."""
        asked = {one.key: one for one in (parts[0].whole(), *parts)}
        todo = [key for key in asked if key not in self.known]
        found = self.pool.map(self.factor, [asked[key] for key in todo])
        self.known.update(zip(todo, found, strict=True))
        return np.array([self.known[one.key] for one in parts]) - self.known[parts[0].whole().key]


@dataclass(frozen=True, eq=False)
class Margin:
    """By how many nats an answer is given.

    Attributes
    ----------
    whole : float
        By all recordings.
    gains : (n_events,) array
        What each avalanche takes of it by itself, nearly: in their order they are left out.
    own : Change
    other : Change, optional
        Of what the answer is compared with; nothing if None.
    """

    whole: float
    gains: FloatArray
    own: Change
    other: Change | None = None

    @property
    def without_third(self) -> Part:
        """The recordings without the third of the avalanches that take most of it."""
        return self.without_first(self._third)

    @property
    def _third(self) -> int:
        return int(MOST * len(self.gains))

    def left_by(self, parts: Sequence[Part]) -> FloatArray:
        """By parts of the recordings."""
        left = self.whole + self.own.without(parts)
        return left if self.other is None else left - self.other.without(parts)

    def without_first(self, many: int) -> Part:
        """The recordings without the avalanches that take most of it."""
        return Part(~np.isin(np.arange(len(self.gains)), np.argsort(-self.gains)[:many]))

    def fewest(self) -> tuple[BoolArray, float] | None:
        """The fewest avalanches without which none is left, and what is; None: more than a third."""

        def left(many: int) -> float:
            return float(self.left_by([self.without_first(many)])[0])

        most = min(self._third, int(np.count_nonzero(self.gains > 0.0)))
        if most == 0 or left(most) >= 0.0:
            return None
        # Each one more that speaks for the answer leaves less: their number is found by halving.
        many = 1 + bisect_left(range(1, most), True, key=lambda so_many: left(so_many) < 0.0)
        return ~self.without_first(many).kept, left(many)
