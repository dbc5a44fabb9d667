"""The dashboard as one file: every view in it, and the programs that draw them; it asks for nothing."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from bokeh.resources import INLINE

from skred.dashboard.answer import answer, entries
from skred.dashboard.page import TITLE, asset, body
from skred.dashboard.reading import Given
from skred.errors import InputError
from skred.output import write_text

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src {scripts}; \
style-src 'unsafe-inline'; img-src data: blob:; font-src data:; connect-src 'none'; \
base-uri 'none'; form-action 'none'">
<link rel="icon" href="data:,">
<style>{css}</style></head><body>
"""


def export(given: Given, file: Path, tell: Callable[[str], None] = lambda line: None) -> Path:
    """Write the dashboard as one page that needs neither network nor server.

    Parameters
    ----------
    given : Given
    file : Path
        Ends in ``.html``.
    tell : callable
        Takes a line for each view that is made.

    Raises
    ------
    InputError
        If the file is not to be a page, or cannot be there.
    """
    check_target(file)
    asked = entries(given)
    scripts = [*_programs(), asset("ask_file.js") + asset("dashboard.js")]
    head = _HEAD.format(title=TITLE, css=asset("dashboard.css"), scripts=" ".join(map(_source, scripts)))
    parts = [head, body(given, asked)]
    for number, entry in enumerate(asked):
        tell(f"view {number + 1} of {len(asked)}: {entry.key}")
        data = _packed(answer(entry, given))
        parts.append(f'<script type="text/plain" id="answer-{entry.key}">{data}</script>\n')
    parts += [f"<script>{script}</script>\n" for script in scripts]
    parts.append("</body></html>\n")
    write_text(file, "".join(parts))
    return file


def _source(script: str) -> str:
    """A program that the page may run, by its digest: what a name in a file smuggles in is none of them."""
    return f"'sha256-{base64.b64encode(sha256(script.encode('utf-8')).digest()).decode('ascii')}'"


def _packed(view: dict[str, Any]) -> str:
    """A view as text that the page unpacks; a third of its size, so that the file can be sent by mail."""
    plain = json.dumps(view, allow_nan=False, separators=(",", ":")).encode("utf-8")
    return base64.b64encode(zlib.compress(plain, level=9)).decode("ascii")


def check_target(file: Path) -> None:
    """Refuse a file that cannot be written, before the work.

    Raises
    ------
    InputError
        If so.
    """
    if file.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--export {file}: expected a name that ends in .html")
    if file.is_dir() or not file.absolute().parent.is_dir():
        raise InputError(
            f"--export {file}: no such folder to write into, or a folder is there; choose another"
        )


def _programs() -> list[str]:
    """Bokeh itself, without what no figure here needs."""
    wanted = INLINE.clone(components=["bokeh"])
    # A browser reads every end of a line as a line feed, and digests what it read.
    plain = (script.replace("\r\n", "\n").replace("\r", "\n") for script in wanted.js_raw)
    return [script.replace("</script", "<\\/script") for script in plain]
