"""Panels as a page carries them beside a drawing: packed, with colours that follow light and dark."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bokeh.colors import named
from bokeh.embed import json_item

from skred.report.explore.panel import NotShownError, Panel
from skred.report.shared.drawing import Exploration
from skred.report.shared.inline import colours_in
from skred.report.shared.programs import packed, plain


@dataclass(frozen=True)
class Plot:
    """A plot of ArviZ.

    Attributes
    ----------
    name : str
        Of the function.
    how : str
        How to read it.
    make : callable
        Makes its panels.
    """

    name: str
    how: str
    make: Callable[[], Sequence[Panel]]


def exploration(*plots: Plot) -> Exploration | None:
    """Make the figures that can be explored in place of a drawing.

    Parameters
    ----------
    *plots : Plot
        One that has nothing to show is left out.

    Returns
    -------
    Exploration or None
        None where there is nothing to show: the drawing stands alone.
    """
    shown = []
    for plot in plots:
        panels = [panel for panel in _made(plot) if _draws(panel.figure)]
        if panels:
            shown.append({"plot": plot.name, "how": plot.how, "panels": [_plain(panel) for panel in panels]})
    if not shown:
        return None
    text = plain(shown)
    return Exploration(packed(text), frozenset(colours_in(text)))


def _made(plot: Plot) -> Sequence[Panel]:
    try:
        return plot.make()
    except NotShownError:
        return ()


def _plain(panel: Panel) -> dict[str, Any]:
    """A panel as plain data."""
    return {"title": panel.title, "note": panel.note, "wide": panel.wide, "item": _item(panel.figure)}


def _draws(figure: Any) -> bool:
    """Whether there is anything in a figure: a number that is always the same has no density."""
    return figure is not None and bool(figure.renderers)


def _item(figure: Any) -> Any:
    """A figure as plain data: the same for the same figure, in colours of the page's style."""
    numbers: dict[str, str] = {}  # bokeh counts its models through all figures of a process

    def plainly(part: Any, key: str = "") -> Any:
        if isinstance(part, dict):
            inside = key if "color" in key else ""
            return {name: plainly(one, inside if name == "value" else name) for name, one in part.items()}
        if isinstance(part, (list, tuple)):
            return [plainly(one, key) for one in part]
        if isinstance(part, str) and key in ("id", "root_id"):
            return numbers.setdefault(part, f"m{len(numbers)}")
        return _variable(part) if isinstance(part, str) and "color" in key else part

    item: dict[str, Any] = dict(json_item(figure))
    item["doc"].pop("defs", None)  # models of other packages, such as panel's where it is imported
    return plainly(item)


def _variable(colour: str) -> str:
    """A colour as drawings refer to it: the page's style says what it is in the light and in the dark."""
    known = getattr(named, colour, None)
    text = known.to_hex() if known is not None else colour
    return f"var(--c{text[1:].lower()})" if re.fullmatch(r"#[0-9a-fA-F]{6}", text) else colour
