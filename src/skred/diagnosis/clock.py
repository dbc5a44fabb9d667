"""How long each stage of a diagnosis takes, told as it begins, and how far a long one has come."""

from __future__ import annotations

import time
from collections.abc import Callable

Tell = Callable[[str], None]
Progress = Callable[[int, int], None]
"""Is told how much is done, and of how much."""
_TOLD_EVERY_S = 10.0
"""Seconds between two lines on how far a stage has come: those that are done sooner say nothing."""


class Clock:
    """Seconds of each stage, told as they begin."""

    def __init__(self, tell: Tell) -> None:
        self.tell, self.seconds = tell, dict[str, float]()
        self._last, self._name = time.monotonic(), ""
        self._told = self._last
        self._first: tuple[float, int] | None = None

    def stage(self, name: str, line: str) -> None:
        """Begin a stage."""
        self.end()
        self._name = name
        self.tell(line)

    def progress(self, done: int, of: int) -> None:
        """Tell how much of the present stage is done, and about how long the rest takes.

        Reckoned from the first that is told of: a stage may begin with something else.
        """
        now = time.monotonic()
        if self._first is None or done < self._first[1]:
            self._first = now, done
        began, before = self._first
        if before < done < of and now - self._told > _TOLD_EVERY_S:
            left = (now - began) * (of - done) / (done - before)
            self.tell(f"  {done} of {of}, about {_in_words(left)} left")
            self._told = now

    def end(self) -> None:
        """End the present stage."""
        now = time.monotonic()
        if self._name:
            self.seconds[self._name] = self.seconds.get(self._name, 0.0) + now - self._last
        self._last, self._name, self._told, self._first = now, "", now, None


def _in_words(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"
