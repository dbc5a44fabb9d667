"""Figures of a result: as files beside the page, and as markup inside it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from skred.parallel.processes import in_processes
from skred.report.shared.inline import inline_svg
from skred.report.shared.labels import printable
from skred.report.shared.style import narrow, write_png

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

_UNLABELLED = 'aria-label=""'
_drawing = Lock()
"""Matplotlib's settings are one for all threads."""


@dataclass(frozen=True)
class Exploration:
    """Figures of the same data that a page draws in place of a drawing, where one asks for them.

    Attributes
    ----------
    data : str
        Packed, see `skred.report.shared.programs.packed`.
    colours : frozenset of str
        That they refer to, as ``#rrggbb``.
    """

    data: str
    colours: frozenset[str]

    @property
    def size(self) -> int:
        """Characters that it takes in a page, with the element around it."""
        return len(self.data) + 64


@dataclass(frozen=True)
class Picture:
    """A figure that was made.

    Attributes
    ----------
    file : Path
        PNG, for slides and papers.
    wide, narrow : str
        Markup for the page: one of the two is shown, by the width of the screen.
    exploration : Exploration or None
        What can be looked at in its place.
    """

    file: Path
    wide: str
    narrow: str
    exploration: Exploration | None = None

    @property
    def size(self) -> int:
        """Characters that it takes in a page."""
        return len(self.wide) + len(self.narrow)

    def markup(self, words: str) -> Markup:
        """Both for the page, with what they show told to those who cannot see it."""
        from markupsafe import Markup, escape

        label = f'aria-label="{escape(" ".join(printable(words).split()))}"'
        parts = zip(("wide", "narrow"), (self.wide, self.narrow), strict=True)
        drawings = Markup("").join(
            Markup(f'<div class="{name}-figure">{text.replace(_UNLABELLED, label, 1)}</div>')
            for name, text in parts
        )
        if self.exploration is None:
            return drawings
        block = Markup('<script type="text/plain" class="exploration-data">{}</script>')
        return drawings + block.format(self.exploration.data)


def draw(
    makers: Mapping[str, Callable[[], Figure | None]],
    folder: Path,
    key: str = "",
    explorations: Mapping[str, Callable[[], Exploration | None]] | None = None,
) -> dict[str, Picture]:
    """Make figures, each wide and narrow, and write the wide one as PNG.

    Parameters
    ----------
    makers : mapping of str to callable
        By name; one that makes None has nothing to show and is left out.
    folder : Path
        An existing folder.
    key : str
        Letters that tell figures of the same name in one page apart.
    explorations : mapping of str to callable, optional
        By the name of the figure in whose place they are looked at.
    """
    explorations = explorations or {}
    jobs = [
        (make, folder / f"{name}.png", f"{key}f{number}", explorations.get(name))
        for number, (name, make) in enumerate(makers.items())
    ]
    drawn = zip(makers, in_processes(_drawn, jobs), strict=True)
    return {name: picture for name, picture in drawn if picture is not None}


def _drawn(
    make: Callable[[], Figure | None], file: Path, key: str, explore: Callable[[], Exploration | None] | None
) -> Picture | None:
    with _drawing:
        figure = make()
        if figure is None:
            return None
        write_png(figure, file)
        wide = inline_svg(figure, f"{key}w")
        narrow_one = _for_telephones(make, f"{key}n") or inline_svg(figure, f"{key}n")
        return Picture(file, wide, narrow_one, explore() if explore is not None else None)


def _for_telephones(make: Callable[[], Figure | None], key: str) -> str:
    """The figure for a narrow screen; empty where its names are so long that nothing else has room there."""
    with narrow(), warnings.catch_warnings():
        warnings.filterwarnings("error", message="constrained_layout not applied")
        figure = make()
        assert figure is not None
        try:
            return inline_svg(figure, key)
        except UserWarning as warning:
            if "constrained_layout" not in str(warning):
                raise
            return ""
