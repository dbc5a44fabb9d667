"""The dashboard served by panel, to this machine only: a view is made when it is first looked at."""

from __future__ import annotations

import importlib
import json
import logging
import threading
from collections.abc import Callable
from typing import Any

import panel
from bokeh.models import TextInput
from bokeh.server.auth_provider import AuthProvider
from panel.io.server import get_server
from tornado.web import HTTPError, RequestHandler

from skred.dashboard.answer import Entry, answer, entries
from skred.dashboard.page import TITLE, asset, body
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.errors import InputError
from skred.report.shared.programs import program

ADDRESS = "127.0.0.1"
_OUR_NAMES = ("localhost", ADDRESS)
_LONGEST_QUESTION = 100_000
_MOST_ASKED = 100
_TEMPLATE = """{% extends base %}
{% block postamble %}<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="\
default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self' ws://localhost:*; \
object-src 'none'; base-uri 'none'; form-action 'none'">
<link rel="icon" href="data:,"><style>{{ dashboard_css }}</style>{% endblock %}
{% block contents %}{{ dashboard_body }}
<div hidden>{{ embed(roots.question) }}{{ embed(roots.reply) }}</div>
<script>{{ dashboard_ask }}</script><script>{{ dashboard_js }}</script>{% endblock %}
"""
# What comes from files is in variables, never in the template itself, where it could be a program.


class LocalOnly(AuthProvider):
    """Answers requests that name this machine, and no others.

    A page elsewhere may have its own name resolved to this machine (DNS rebinding). Its requests still name
    it, and bokeh asks for the user of each request but those of its own scripts.
    """

    @property
    def get_user(self) -> Callable[[RequestHandler], str]:
        """Everybody who asks this machine by its name is one user."""
        return _local_user

    @property
    def login_url(self) -> str:
        """Nobody is sent here: others get 403."""
        return "/"


def _local_user(handler: RequestHandler) -> str:
    if handler.request.host_name.lower() not in _OUR_NAMES:
        raise HTTPError(403, "served to this machine only")
    return "local"


class Answers:
    """Makes views when they are asked for, and keeps those that were made.

    Parameters
    ----------
    given : Given
    """

    def __init__(self, given: Given) -> None:
        self.given = given
        self.entries: dict[str, Entry] = {entry.key: entry for entry in entries(given)}
        self._made: dict[str, dict[str, Any]] = {}

    def reply(self, question: str) -> str:
        """Answer a question of the page, JSON both; one that makes no sense gets an empty view."""
        try:
            asked = json.loads(question[:_LONGEST_QUESTION])
            key, number = str(asked["key"]), str(asked["id"])
            wanted = tuple(str(one) for one in asked.get("parameters") or ())[:_MOST_ASKED]
        except (ValueError, KeyError, TypeError, AttributeError):
            return json.dumps({"id": "", "html": "", "items": []})
        return json.dumps({**self._view(key, wanted), "id": number})

    def _view(self, key: str, wanted: tuple[str, ...]) -> dict[str, Any]:
        entry = self.entries.get(key)
        if entry is None:
            return {"html": "", "items": []}
        if wanted:
            return answer(entry, self.given, Asked(wanted, can_choose=True))
        if key not in self._made:
            self._made[key] = answer(entry, self.given, Asked(can_choose=True))
        return self._made[key]


def session(answers: Answers) -> panel.Template:
    """The page of one visitor."""
    question, reply = TextInput(tags=["skred-question"]), TextInput(tags=["skred-reply"])

    def replied(attribute: str, old: str, new: str) -> None:
        reply.value = answers.reply(new)

    question.on_change("value", replied)
    page = panel.Template(_TEMPLATE)
    page.title = TITLE
    page.add_variable("dashboard_css", asset("dashboard.css"))
    page.add_variable("dashboard_body", body(answers.given, list(answers.entries.values())))
    page.add_variable("dashboard_ask", asset("ask_server.js"))
    page.add_variable("dashboard_js", program("marks.js") + asset("dashboard.js"))
    page.add_panel("question", panel.pane.Bokeh(question))
    page.add_panel("reply", panel.pane.Bokeh(reply))
    return page


def start(given: Given, port: int = 0) -> tuple[Any, str]:
    """Start to serve; the event loop of the server that is returned is to be run by the caller.

    Parameters
    ----------
    given : Given
    port : int
        0 for any free one.

    Returns
    -------
    server : bokeh.server.server.Server
    url : str

    Raises
    ------
    InputError
        If the port is taken.
    """
    answers = Answers(given)
    logging.getLogger("bokeh").setLevel(logging.ERROR)
    logging.getLogger("tornado.access").setLevel(logging.ERROR)
    try:
        server = get_server(
            lambda: session(answers), port=port, address=ADDRESS, show=False, start=False, title=TITLE,
            websocket_max_message_size=_LONGEST_QUESTION * 10, auth_provider=LocalOnly(),
        )  # fmt: skip
    except OSError as error:
        raise InputError(
            f"--port {port}: cannot be served on ({error}); choose another, or 0 for any"
        ) from error
    server.start()
    threading.Thread(target=_import_plots, daemon=True).start()
    return server, f"http://localhost:{server.port}/"


def _import_plots() -> None:
    """What the first view would wait for."""
    importlib.import_module("arviz_plots")


def serve(
    given: Given, *, port: int = 0, open_browser: bool = True, tell: Callable[[str], None] = print
) -> None:
    """Serve the dashboard until Ctrl-C.

    Raises
    ------
    InputError
        If the port is taken.
    """
    server, url = start(given, port)
    print(url, flush=True)
    tell("served to this machine only; Ctrl-C ends it")
    if open_browser:
        server.io_loop.add_callback(server.show, "/")
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
