"""A view of a run as plain data: markup, and figures for bokeh to embed. Server and file send the same."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

from bokeh.embed import json_item
from markupsafe import Markup

from skred.dashboard.catalogue import VIEWS
from skred.dashboard.parameters import Choice, choice
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked, ViewKind
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import OF_A_FILE, Run

_NUMBER = itertools.count()


@dataclass(frozen=True)
class Entry:
    """A view that can be asked for.

    Attributes
    ----------
    key : str
        View and run.
    view : ViewKind
    run : Run or None
        None where the view is of all runs.
    """

    key: str
    view: ViewKind
    run: Run | None


def entries(given: Given) -> list[Entry]:
    """All views that there are of what was given."""
    found = []
    for view in VIEWS:
        if view.over_all:
            if view.id == "overview" or any(_applies(view, run) for run in given.runs):
                found.append(Entry(view.id, view, None))
            continue
        found += [Entry(f"{view.id}-{run.key}", view, run) for run in given.runs if _applies(view, run)]
    return found


def _applies(view: ViewKind, run: Run) -> bool:
    """Whether a view can be made; a stranger's file that it stumbles over has no such view."""
    try:
        return view.applies(run)
    except OF_A_FILE:
        return False


def answer(entry: Entry, given: Given, asked: Asked = Asked()) -> dict[str, Any]:  # noqa: B008
    """Make a view.

    Returns
    -------
    dict
        ``html``: its markup, every text from a file escaped; ``items``: a figure for each, with the id of the
        element that it goes to.
    """
    chosen = None
    try:
        if entry.view.by_parameter:
            chosen = choice(entry.view, entry.run, given, asked)
            asked = replace(asked, parameters=chosen.shown)
        panels = entry.view.make(entry.run, given, asked)
        targets = [f"fig-{next(_NUMBER)}" for _ in panels]
        items = [
            json_item(panel.figure, target)
            for panel, target in zip(panels, targets, strict=True)
            if panel.figure is not None
        ]
    except NotShownError as error:
        return {"html": _told(str(error)), "items": []}
    except Exception as error:  # a stranger's file: whatever a library makes of it, the page goes on
        what = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        return {"html": _told(f"This view could not be made of this file: {what}"), "items": []}
    markup = Markup("").join(_panel(panel, target) for panel, target in zip(panels, targets, strict=True))
    return {"html": str(_choice(chosen, asked) + markup), "items": items}


def _told(message: str) -> str:
    return str(Markup('<p class="box wide">{}</p>').format(message[:1].upper() + message[1:]))


def _panel(panel: Panel, target: str) -> Markup:
    figure = (
        Markup('<div class="fig" id="{}" role="group" aria-label="{}"></div>').format(target, panel.title)
        if panel.figure is not None
        else ""
    )
    note = Markup('<p class="note">{}</p>').format(panel.note) if panel.note else ""
    made = Markup('<section class="panel{}"><h3>{}</h3>{}{}{}</section>')
    return made.format(" wide" if panel.wide else "", panel.title, Markup(panel.html), figure, note)


def _choice(chosen: Choice | None, asked: Asked) -> Markup:
    """Which of many parameters are shown; only a server can change that."""
    if chosen is None or len(chosen.labels) <= chosen.most:
        return Markup("")
    told = f"{len(chosen.shown)} of {len(chosen.labels)} parameters are shown"
    if not asked.can_choose:
        return Markup('<p class="note wide">{}; the served dashboard can show others.</p>').format(told)
    shown = frozenset(chosen.shown)
    boxes = Markup("").join(
        Markup('<label><input type="checkbox" data-parameter value="{0}"{1}> {0}</label>').format(
            label, Markup(" checked") if label in shown else ""
        )
        for label in chosen.labels
    )
    return Markup(
        '<details class="wide parameters"><summary>{}</summary>'
        '<div class="boxes">{}</div>'
        '<button type="button" data-again>Show these (at most {})</button></details>'
    ).format(told, boxes, chosen.most)
