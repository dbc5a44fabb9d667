"""Links between pages lead somewhere, and every page is in the navigation. No network is asked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from page_links import DOCS, PAGES, ROOT, problems_of, text_of


class Loader(yaml.SafeLoader):
    """For mkdocs.yml, in which one function of a package is called by name."""


Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda loader, suffix, node: suffix)
SITE = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader)


def pages_of(nav: Any) -> Iterator[str]:
    """All pages of a navigation, in order."""
    if isinstance(nav, str):
        yield nav
    else:
        for part in nav.values() if isinstance(nav, dict) else nav:
            yield from pages_of(part)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page: Path) -> None:
    assert problems_of(page, text_of(page)) == []


@pytest.mark.parametrize(
    ("link", "problem"),
    [
        ("method.md", None),
        ("method.md#known-limits", None),
        ("#here-it-is", None),
        ("figures/track.png", None),
        ("https://example.org/nowhere", None),
        ("methods.md", "no such file"),
        ("figures/tracks.png", "no such file"),
        ("method.md#nowhere", "no such heading"),
        ("#here-it-was", "no such heading"),
    ],
)
def test_a_link_that_leads_nowhere_is_seen(link: str, problem: str | None) -> None:
    found = problems_of(DOCS / "index.md", f"# Here it is\n\n[a link]({link})\n")
    assert found == ([] if problem is None else [f"{link}: {problem}"])


def test_the_navigation_has_every_page_once() -> None:
    listed = list(pages_of(SITE["nav"]))
    there = {str(page.relative_to(DOCS)) for page in PAGES if page.is_relative_to(DOCS)}
    assert sorted(listed) == sorted(there)


def test_warnings_are_errors() -> None:
    assert SITE["strict"] is True
    told = {key: how for part in SITE["validation"].values() for key, how in part.items()}
    assert told == dict.fromkeys(told, "warn")
    assert {"omitted_files", "not_found", "anchors", "absolute_links", "unrecognized_links"} <= set(told)
