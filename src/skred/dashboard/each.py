"""Views over all runs: a run that one cannot be made of is named, and the others are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from markupsafe import Markup

from skred.report.explore.panel import Panel
from skred.report.explore.run import Run

T = TypeVar("T")


class Failures:
    """What could not be made of which run, collected while a view is made."""

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    def of_each(self, runs: Iterable[Run], make: Callable[[Run], T]) -> list[tuple[Run, T]]:
        """Make something of each run, but for those where it fails."""
        made = []
        for run in runs:
            try:
                made.append((run, make(run)))
            except Exception as error:  # a stranger's file: whatever a library makes of it, the others go on
                what = " ".join(f"{type(error).__name__}: {error}".split())[:160]
                self._told.setdefault(f"run {run.number}, {run.title}", what)
        return made

    def panels(self) -> list[Panel]:
        """A panel that names those runs; none where all went well."""
        if not self._told:
            return []
        rows = Markup("").join(
            Markup("<li>{}: {}</li>").format(name, what) for name, what in self._told.items()
        )
        html = Markup('<div class="box"><ul>{}</ul></div>').format(rows)
        return [Panel("Could not be shown of these runs", html=str(html), wide=True)]
