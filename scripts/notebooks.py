"""Notebooks that are kept as text: run one, and turn what came out into a page of Markdown.

A notebook is a Python file in the percent format of jupytext. The cell with the tag ``parameters`` says how
much is computed; `run` can put other values behind it.
"""

from __future__ import annotations

import base64
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient
from traitlets.config import Config

SECONDS = 900
"""Longest time of one cell, on a slow machine that does other work too."""
PLAIN = re.compile(
    r"<style scoped>.*?</style>| border=\"1\" class=\"dataframe\"| style=\"text-align: right;\"", re.S
)
"""What pandas says of the looks of a table; the site has its own."""
ESCAPES = re.compile(r"\x1b\[[0-9;]*m")


@dataclass(frozen=True)
class Shown:
    """A notebook as a page.

    Attributes
    ----------
    text : str
        Markdown.
    figures : dict of bytes
        PNG files by the names that the text has.
    """

    text: str
    figures: dict[str, bytes]


def read(path: Path) -> Any:
    """A notebook from its text, not yet run."""
    return jupytext.read(path)


def run(path: Path, given: Mapping[str, object] | None = None) -> Any:
    """Run a notebook in an empty folder of its own.

    Parameters
    ----------
    path : Path
        Python in the percent format.
    given : mapping, optional
        Values in place of those of the cell ``parameters``.

    Returns
    -------
    notebook
        With what every cell printed and drew.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails; the message has the cell and its traceback.
    """
    notebook = read(path)
    if given:
        lines = "\n".join(f"{name} = {value!r}" for name, value in given.items())
        notebook.cells.insert(_behind_parameters(notebook), nbformat.v4.new_code_cell(lines))
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as sockets:
        # Files of this user instead of ports, which others on the machine could listen to.
        settings = Config({"KernelManager": {"transport": "ipc", "ip": f"{sockets}/kernel"}})
        resources = {"metadata": {"path": folder}}
        client = NotebookClient(notebook, timeout=SECONDS, resources=resources, config=settings)
        client.execute(env=_environment())
    return notebook


def _environment() -> dict[str, str]:
    """With the commands of this Python first, and lines that fit a page."""
    commands = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {**os.environ, "PATH": commands, "COLUMNS": "96"}


def _behind_parameters(notebook: Any) -> int:
    for number, cell in enumerate(notebook.cells):
        if "parameters" in cell.metadata.get("tags", ()):
            return number + 1
    raise ValueError("no cell of the notebook has the tag 'parameters'")


def shown(notebook: Any, name: str) -> Shown:
    """A notebook as a page, with all that its cells put out.

    Parameters
    ----------
    notebook
        Run or not.
    name : str
        First part of the names of its figures.
    """
    parts: list[str] = []
    figures: dict[str, bytes] = {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        elif cell.cell_type == "code":
            parts.append(_input(cell.source))
            parts += [_output(output, cell.metadata, name, figures) for output in _joined(cell.outputs)]
    return Shown("\n\n".join(part for part in parts if part) + "\n", figures)


def _input(code: str) -> str:
    """A cell of Python, or commands as they are typed."""
    commands = code.removeprefix("%%bash\n")
    return f"```{'python' if commands == code else 'console'}\n{commands}\n```"


def _joined(outputs: Iterable[Any]) -> list[Any]:
    """What was printed piece by piece, errors among the rest, as one piece."""
    found: list[Any] = []
    for output in outputs:
        if output.output_type == "stream" and found and found[-1].output_type == "stream":
            found[-1] = nbformat.v4.new_output("stream", text=found[-1].text + output.text)
        else:
            found.append(output)
    return found


def _output(output: Any, metadata: Mapping[str, Any], name: str, figures: dict[str, bytes]) -> str:
    """One output: text and HTML as they are, Markdown as a quotation, a figure as a file."""
    if output.output_type == "stream":
        return _text(output.text)
    data = output.get("data", {})
    if "image/png" in data:
        file = f"{name}-{len(figures) + 1}.png"
        figures[file] = base64.b64decode(data["image/png"])
        return f"![{metadata['alt']}]({file})"
    if "text/markdown" in data:
        return "\n".join(f"> {line}" for line in data["text/markdown"].splitlines())
    if "text/html" in data:
        lines = [line.strip() for line in PLAIN.sub("", data["text/html"]).splitlines()]
        return '<div class="output">' + "".join(line for line in lines if line) + "</div>"
    return _text(data.get("text/plain", ""))


def _text(said: str) -> str:
    """What a cell printed, without colours, so fenced that it may hold a fence itself."""
    said = "\n".join(line.rstrip() for line in ESCAPES.sub("", said).splitlines()).rstrip()
    return f"````{{.text .output}}\n{said}\n````" if said else ""
