"""The dashboard as one file: every view in it, and the programs that draw them; it asks for nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from skred.dashboard.answer import answer, entries
from skred.dashboard.page import TITLE, asset, body
from skred.dashboard.reading import Given
from skred.errors import InputError
from skred.output import write_text
from skred.report.shared.programs import bokeh_program, digest, packed, plain, program

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src {scripts}; \
style-src 'unsafe-inline'; img-src data: blob:; font-src data:; connect-src 'none'; \
base-uri 'none'; form-action 'none'">
<link rel="icon" href="data:,">
<style>{css}</style></head><body>
"""


def export(
    given: Given, file: Path, tell: Callable[[str], None] = lambda line: None, *, force: bool = False
) -> Path:
    """Write the dashboard as one page that needs neither network nor server.

    Parameters
    ----------
    given : Given
    file : Path
        Ends in ``.html``.
    tell : callable
        Takes a line for each view that is made.
    force : bool
        Replace a file that is there.

    Raises
    ------
    InputError
        If the file is not to be a page, or cannot be there.
    """
    check_target(file, force=force)
    asked = entries(given)
    ours = (program("unpack.js"), asset("ask_file.js"), program("marks.js"), asset("dashboard.js"))
    scripts = [bokeh_program(), "".join(ours)]
    head = _HEAD.format(title=TITLE, css=asset("dashboard.css"), scripts=" ".join(map(digest, scripts)))
    parts = [head, body(given, asked)]
    for number, entry in enumerate(asked):
        tell(f"view {number + 1} of {len(asked)}: {entry.key}")
        data = packed(plain(answer(entry, given)))
        parts.append(f'<script type="text/plain" id="answer-{entry.key}">{data}</script>\n')
    parts += [f"<script>{script}</script>\n" for script in scripts]
    parts.append("</body></html>\n")
    write_text(file, "".join(parts))
    return file


def check_target(file: Path, *, force: bool = False) -> None:
    """Refuse a file that cannot be written or is there already, before the work.

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
    if file.exists() and not force:
        raise InputError(f"--export {file}: is there already; choose another, or --force to replace it")
