"""For MkDocs (`hooks` in mkdocs.yml): every notebook of docs/notebooks is run and becomes a page.

``SKRED_NOTEBOOKS=text`` shows them without running them, ``SKRED_NOTEBOOKS=quick`` runs those in `QUICK` with
the values there. What was run is kept in ``.cache/notebooks`` until a notebook, the package or its data
change.
"""

from __future__ import annotations

import hashlib
import logging
import os
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from nbclient.exceptions import CellExecutionError

from scripts import notebooks

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / ".cache" / "notebooks"
QUICK = {"arviz_results": {"DRAWS": 100}}
"""Enough to see that all cells work; the other notebooks diagnose, which takes minutes on a slow machine."""
LOG = logging.getLogger("mkdocs.plugins.notebooks")


class NotebookFile(File):
    """A text of Python that is a page, under its own name."""

    def is_documentation_page(self) -> bool:
        """Also where MkDocs looks at the ending of the name."""
        return True


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Put a page, its figures and the notebook itself in place of the text."""
    how = os.environ.get("SKRED_NOTEBOOKS", "full")
    if how not in ("full", "quick", "text"):
        raise PluginError(f"SKRED_NOTEBOOKS is {how!r}; expected full, quick or text")
    for file in [one for one in files if one.src_uri.startswith("notebooks/") and one.src_uri[-3:] == ".py"]:
        source = Path(str(file.abs_src_path))
        is_run = how == "full" or (how == "quick" and source.stem in QUICK)
        notebook = _run(source, how) if is_run else notebooks.read(source)
        page = notebooks.shown(notebook, source.stem)
        named = source.with_suffix(".ipynb").name
        text = page.text.replace("\n\n", f"\n\n{_download(named)}\n\n", 1)
        files.remove(file)
        files.append(NotebookFile.generated(config, file.src_uri, content=text))
        files.append(File.generated(config, f"notebooks/{named}", content=nbformat.writes(notebook)))
        for name, figure in page.figures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=figure))
    return files


def _download(name: str) -> str:
    return f"[Download this page as a Jupyter notebook]({name}){{ .md-button download }}"


def _run(source: Path, how: str) -> Any:
    """Run a notebook, unless it was run as it is with the package as it is."""
    kept = KEPT / f"{source.stem}-{_fingerprint(source, how)}.ipynb"
    if kept.is_file():
        return nbformat.read(kept, as_version=4)
    LOG.info("running %s", source.name)
    try:
        notebook = notebooks.run(source, QUICK.get(source.stem) if how == "quick" else None)
    except CellExecutionError as error:
        raise PluginError(f"{source.name}: a cell failed\n{error}") from error
    KEPT.mkdir(parents=True, exist_ok=True)
    for stale in KEPT.glob(f"{source.stem}-*.ipynb"):
        stale.unlink()
    nbformat.write(notebook, kept)
    return notebook


def _fingerprint(source: Path, how: str) -> str:
    """Of all that can change what a notebook shows, as far as it is ours."""
    found = hashlib.sha256(f"{how} {QUICK}".encode())
    rooms = [ROOT / "src", ROOT / "models", ROOT / "data"]
    for file in [source, *sorted(one for room in rooms for one in room.rglob("*"))]:
        if file.is_file() and file.suffix != ".pyc":
            found.update(f"{file.relative_to(ROOT)}\n".encode() + file.read_bytes())
    return found.hexdigest()[:16]
