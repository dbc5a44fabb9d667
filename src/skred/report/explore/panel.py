"""A panel: a figure or a table with its title, and what to say of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skred.errors import InputError


class NotShownError(InputError):
    """There is nothing to show of a run; the message says why."""


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
