"""The site is made without a warning, needs no other host, and has what it should.

Of the dependency group ``site``; notebooks are shown here without being run.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from built_site import ROOT, Page, build, lost

import skred

pytest.importorskip("mkdocs", reason="the group `site` is not installed: uv run --group site pytest")


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    """Every page of it, but the one for what is not found, which servers show at any address."""
    return {file: Page(file) for file in sorted(site.rglob("*.html")) if file.name != "404.html"}


def test_every_link_leads_somewhere(pages: dict[Path, Page]) -> None:
    assert len(pages) > 20
    assert lost(pages) == []


def test_no_page_fetches_from_another_host(pages: dict[Path, Page], site: Path) -> None:
    fetched = {target for page in pages.values() for target in page.fetched}
    assert fetched and not [target for target in fetched if re.match(r"(\w+:)?//", target)]
    styles = "".join(file.read_text(encoding="utf-8") for file in site.rglob("*.css"))
    assert not re.findall(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//[^)]*", styles)


def test_every_figure_has_words_for_those_who_do_not_see_it(pages: dict[Path, Page]) -> None:
    assert {file.name: page.unnamed_images for file, page in pages.items() if page.unnamed_images} == {}


def test_every_public_name_is_in_the_api(pages: dict[Path, Page], site: Path) -> None:
    anchors = {anchor.rpartition(".")[2] for anchor in pages[site / "api.html"].anchors if "." in anchor}
    assert set(skred.__all__) <= anchors, anchors
    assert {"report", "tree", "statement"} <= anchors


def test_search_needs_no_server(site: Path) -> None:
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert index.startswith("var __index = ") and "Pareto" in index
    start = (site / "index.html").read_text(encoding="utf-8")
    assert "assets/search-from-disk.js" in start


def test_the_site_names_no_folder_of_the_machine_that_made_it(site: Path) -> None:
    for file in site.rglob("*"):
        if file.suffix in (".html", ".js", ".json", ".xml", ".ipynb"):
            assert str(ROOT) not in file.read_text(encoding="utf-8"), file


def test_lists_and_tables_became_lists_and_tables(pages: dict[Path, Page]) -> None:
    """MkDocs wants a blank line before them, the hosts of code do not."""
    for file in pages:
        paragraphs = re.findall(r"<p>(.*?)</p>", file.read_text(encoding="utf-8"), re.S)
        assert not [text for text in paragraphs if re.search(r"^(- |\d+\. |\|)", text, re.M)], file


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("[a link](nowhere.md)", "nowhere.md"),
        ("[a link](#nowhere)", "nowhere"),
        ("[a link](other.md#nowhere)", "nowhere"),
        ("", None),
    ],
)
def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path, more: str, told: str | None) -> None:
    done = built_from(tmp_path, f"# A page\n\n[another](other.md)\n\n{more}\n")
    assert (done.returncode == 0) == (told is None), done.stderr
    assert told is None or told in done.stderr


def test_a_page_that_the_navigation_leaves_out_stops_the_build(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "forgotten.md").write_text("# Forgotten\n", encoding="utf-8")
    done = built_from(tmp_path, "# A page\n")
    assert done.returncode != 0 and "forgotten.md" in done.stderr


def built_from(folder: Path, start: str) -> subprocess.CompletedProcess[str]:
    """A small site with the rules of the real one."""
    (folder / "docs").mkdir(exist_ok=True)
    (folder / "docs" / "index.md").write_text(start, encoding="utf-8")
    (folder / "docs" / "other.md").write_text("# Another\n", encoding="utf-8")
    rules = (
        f"INHERIT: {ROOT / 'mkdocs.yml'}\nnav: [index.md, other.md]\nplugins: []\nhooks: []\nextra_css: []\n"
    )
    (folder / "mkdocs.yml").write_text(rules, encoding="utf-8")
    return build(folder / "mkdocs.yml", folder / "site")
