"""Notebooks: kept as text, run from the first cell to the last, shown as pages."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("jupytext", reason="the group `site` is not installed: uv run --group site pytest")

from page_links import DOCS, ROOT

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.py"))
DRAWN = re.compile(r"\bplot_\w+\(|\bImage\(")
PIXEL = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABc3UBGAAAAABJRU5ErkJggg=="


@pytest.fixture
def notebooks(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program that runs and shows them."""
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import notebooks

    return notebooks


def test_there_are_notebooks_and_only_as_text() -> None:
    assert {file.stem for file in NOTEBOOKS} >= {"spreadsheet", "arviz_results", "prediction"}
    assert not list((DOCS / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_every_notebook_begins_with_its_title_and_names_its_figures(file: Path, notebooks: Any) -> None:
    first, *others = notebooks.read(file).cells
    assert first.cell_type == "markdown" and first.source.startswith("# Notebook: ")
    cells = [cell for cell in others if cell.cell_type == "code"]
    assert cells
    for cell in cells:
        if not cell.source.startswith("%%bash\n"):
            ast.parse(cell.source)
        assert bool(DRAWN.search(cell.source)) == ("alt" in cell.metadata), cell.source


def test_what_a_quick_run_changes_is_there_to_be_changed(notebooks: Any) -> None:
    import notebook_pages

    assert notebook_pages.QUICK
    for stem, given in notebook_pages.QUICK.items():
        cells = notebooks.read(DOCS / "notebooks" / f"{stem}.py").cells
        [named] = [cell.source for cell in cells if "parameters" in cell.metadata.get("tags", ())]
        assert set(given) == set(re.findall(r"^(\w+) = ", named, re.M))


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_every_notebook_runs(file: Path, notebooks: Any) -> None:
    import notebook_pages

    cells = notebooks.run(file, notebook_pages.QUICK.get(file.stem)).cells
    assert all(cell.outputs for cell in cells if "alt" in cell.metadata)


TEXT = """\
# %% [markdown]
# # Notebook: small

# %% tags=["parameters"]
N = 2

# %%
import sys
print("<b>", N * 21)
print("\\x1b[1mbold", file=sys.stderr)

# %% language="bash"
# echo "from the shell" \\
#   again

# %% alt="A pixel"
from IPython.display import Image
import base64
Image(base64.b64decode("PIXEL"))

# %%
from IPython.display import Markdown
Markdown("*so*\\nsaid")

# %%
import pandas as pd
pd.DataFrame({"a": [1]}, index=["row"])

# %%
from IPython.display import HTML
HTML("<p>one</p>\\n\\n<p>two</p>")
""".replace("PIXEL", PIXEL)


def test_a_notebook_becomes_a_page_with_all_that_it_puts_out(tmp_path: Path, notebooks: Any) -> None:
    file = tmp_path / "small.py"
    file.write_text(TEXT, encoding="utf-8")
    page = notebooks.shown(notebooks.run(file, {"N": 3}), "small")
    assert "```python\nN = 3\n```" in page.text
    assert "````{.text .output}\n<b> 63\nbold\n````" in page.text
    assert '```console\necho "from the shell" \\\n  again\n```' in page.text
    assert "from the shell again" in page.text
    assert "![A pixel](small-1.png)" in page.text and page.figures["small-1.png"][1:4] == b"PNG"
    assert '<div class="output"><p>one</p><p>two</p></div>' in page.text
    assert "> *so*\n> said" in page.text
    assert "<table><thead><tr><th></th><th>a</th></tr></thead>" in page.text and "<style" not in page.text
    unrun = notebooks.shown(notebooks.read(file), "small")
    assert "63" not in unrun.text and not unrun.figures


def test_a_cell_that_fails_is_an_error(tmp_path: Path, notebooks: Any) -> None:
    from nbclient.exceptions import CellExecutionError

    file = tmp_path / "failing.py"
    file.write_text("# %%\n1 / 0\n", encoding="utf-8")
    with pytest.raises(CellExecutionError, match="division by zero"):
        notebooks.run(file)
    with pytest.raises(ValueError, match="no cell of the notebook has the tag 'parameters'"):
        notebooks.run(file, {"N": 3})
