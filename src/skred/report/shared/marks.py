"""What a reader can point at in a figure: places with words, and the avalanche that they belong to.

A figure function says with `mark` what stands where. `skred.report.shared.inline` lays transparent targets
over the drawing: so hovering and highlighting work alike in every figure, whatever it is drawn with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

MOST_MARKS = 900
"""Of a figure; with more a page would grow by megabytes, and no target could be hit."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A place in a figure.

    Attributes
    ----------
    axes : Axes
    x, y : float
        In data coordinates.
    words : str
        What is told where one points at it.
    event : str or None
        The avalanche, or trial, that it belongs to.
    """

    axes: Axes
    x: float
    y: float
    words: str
    event: str | None


@dataclass(eq=False)
class Notes:
    """What is known of a figure beside its drawing.

    Attributes
    ----------
    marks : list of Mark
    stacked : list of lists of Axes
        Panels that stand side by side in the wide figure and below each other in the narrow one.
    """

    marks: list[Mark] = field(default_factory=list)
    stacked: list[list[Axes]] = field(default_factory=list)


_NOTES: WeakKeyDictionary[Any, Notes] = WeakKeyDictionary()


def notes_of(figure: Figure) -> Notes:
    """The notes of a figure; empty ones where there are none yet."""
    return _NOTES.setdefault(figure, Notes())


def mark(
    axes: Axes, x: ArrayLike, y: ArrayLike, words: Sequence[str], events: Sequence[str] | None = None
) -> None:
    """Say what stands at places of a panel.

    Parameters
    ----------
    axes : Axes
    x, y : (n,) arrays
        Data coordinates; what is not finite is left out.
    words : sequence of n str
    events : sequence of n str, optional
        Ids of the avalanches.
    """
    import numpy as np

    notes = notes_of(axes.get_figure(root=True))  # type: ignore[arg-type]
    at_x, at_y = (np.asarray(values, dtype=float) for values in np.broadcast_arrays(x, y))
    names = events if events is not None else [None] * len(words)
    for one_x, one_y, text, event in zip(at_x.ravel(), at_y.ravel(), words, names, strict=True):
        if np.isfinite(one_x) and np.isfinite(one_y):
            notes.marks.append(Mark(axes, float(one_x), float(one_y), text, event))
