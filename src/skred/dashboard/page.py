"""The page around the views: the same for the server and for the file."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from skred.dashboard.answer import Entry
from skred.dashboard.catalogue import VIEWS
from skred.dashboard.reading import Given
from skred.dashboard.views.events import all_events
from skred.report.explore.run import MOST_EVENTS

TITLE = "skred dashboard"


def asset(name: str) -> str:
    """A file of the page: its script, its style, its body's template."""
    return files("skred.dashboard").joinpath("assets", name).read_text(encoding="utf-8")


def body(given: Given, entries: list[Entry]) -> str:
    """What the page's body holds but for programs, every text escaped."""
    there = {entry.view.id for entry in entries}
    views = [view for view in VIEWS if view.id in there]
    groups: dict[str, list[Any]] = {}
    for view in views:
        groups.setdefault(view.group, []).append(view)
    every_event = all_events(given)
    events = every_event[:MOST_EVENTS]
    catalogue = {
        "entries": [entry.key for entry in entries],
        "views": [{"id": v.id, "title": v.title, "how": v.how, "over_all": v.over_all} for v in views],
        "runs": [{"key": run.key, "title": run.title} for run in given.runs],
        "events": events,
    }
    template = Environment(autoescape=True, trim_blocks=True).from_string(asset("page.html.jinja"))
    return template.render(
        title=TITLE,
        groups=list(groups.items()),
        events=events,
        n_more=len(every_event) - len(events),
        n_troubles=len(given.troubles),
        catalogue=Markup(in_script(catalogue)),
    )


def in_script(data: Any) -> str:
    """JSON that can stand inside of a script element: it holds no tag."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
