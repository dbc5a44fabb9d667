"""How long each stage of a diagnosis takes, told as it begins."""

from __future__ import annotations

import time
from collections.abc import Callable

Tell = Callable[[str], None]


class Clock:
    """Seconds of each stage, told as they begin."""

    def __init__(self, tell: Tell) -> None:
        self.tell, self.seconds = tell, dict[str, float]()
        self._last, self._name = time.monotonic(), ""

    def stage(self, name: str, line: str) -> None:
        """Begin a stage."""
        self.end()
        self._name = name
        self.tell(line)

    def end(self) -> None:
        """End the present stage."""
        now = time.monotonic()
        if self._name:
            self.seconds[self._name] = self.seconds.get(self._name, 0.0) + now - self._last
        self._last, self._name = now, ""
