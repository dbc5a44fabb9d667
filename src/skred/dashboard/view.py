"""What a view is made of: panels of figures and tables, and what to say of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from skred.dashboard.run import MOST_PARAMETERS
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.dashboard.reading import Given
    from skred.dashboard.run import Run


class NotShownError(InputError):
    """A view has nothing to show of a run; the message says why."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A figure or a table.

    Attributes
    ----------
    title : str
    figure : bokeh model or None
    html : str
        Markup of a table, its texts escaped.
    note : str
        Below it.
    wide : bool
        Whether it takes the whole width.
    """

    title: str
    figure: Any = None
    html: str = ""
    note: str = ""
    wide: bool = False


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
