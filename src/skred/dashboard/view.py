"""What a view is, and what can be asked of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from skred.report.explore.panel import Panel
from skred.report.explore.run import MOST_PARAMETERS

if TYPE_CHECKING:
    from skred.dashboard.reading import Given
    from skred.report.explore.run import Run


@dataclass(frozen=True)
class Asked:
    """What is asked of a view.

    Attributes
    ----------
    parameters : sequence of str
        Labels of the parameters to show; the first ones where there is none.
    can_choose : bool
        Whether somebody can ask for others: a server can be asked, a file cannot.
    """

    parameters: Sequence[str] = field(default_factory=tuple)
    can_choose: bool = False


@dataclass(frozen=True, eq=False)
class ViewKind:
    """A kind of view.

    Attributes
    ----------
    id, group, title : str
    how : str
        How to read it, in a sentence or two.
    applies : callable
        Whether it can be made of a run.
    make : callable
        Panels of a run; of all runs where it is `over_all`.
    over_all : bool
        Whether it is made of all runs together.
    by_parameter : bool
        Whether it shows the parameters that are asked for.
    most_parameters : int
        How many of them at a time.
    drawn_from : tuple of str
        Groups that must hold a parameter that it shows.
    """

    id: str
    group: str
    title: str
    how: str
    applies: Callable[[Run], bool]
    make: Callable[[Any, Given, Asked], list[Panel]]
    over_all: bool = False
    by_parameter: bool = False
    most_parameters: int = MOST_PARAMETERS
    drawn_from: tuple[str, ...] = ("posterior",)
