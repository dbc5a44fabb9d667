"""Programs and styles of pages: inside of them, known by their digests, packed where they are long."""

from __future__ import annotations

import base64
import json
import zlib
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Any


def digest(text: str) -> str:
    """A program or style as a Content-Security-Policy names it: what a name in a file smuggles in is none."""
    return f"'sha256-{base64.b64encode(sha256(text.encode('utf-8')).digest()).decode('ascii')}'"


def packed(text: str) -> str:
    """Text as letters and digits that a page unpacks (`unpack.js`): a third of its size."""
    return base64.b64encode(zlib.compress(text.encode("utf-8"), level=9)).decode("ascii")


def plain(data: Any) -> str:
    """Plain data as JSON."""
    return json.dumps(data, allow_nan=False, separators=(",", ":"))


@cache
def bokeh_program() -> str:
    """Bokeh itself, without what no figure here needs, as it can stand inside of a page."""
    from bokeh.resources import INLINE

    (program,) = INLINE.clone(components=["bokeh"]).js_raw[:1]
    # A browser reads every end of a line as a line feed, and digests what it read.
    return str(program).replace("\r\n", "\n").replace("\r", "\n").replace("</script", "<\\/script")


@cache
def packed_bokeh() -> str:
    """Bokeh, packed."""
    return packed(bokeh_program())


@cache
def program(name: str) -> str:
    """A program or style of pages; the dashboard has some of them in common."""
    text = files("skred.report").joinpath("templates", name).read_text(encoding="utf-8")
    return text.replace("\r\n", "\n")
