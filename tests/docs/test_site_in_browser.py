"""The site in a real browser, opened from the disk: search, no other host, nothing wider than a telephone."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the path")
QUIET = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
WIDE = ("index", "api", "campaign-format", "own-data", "reproduction", "notebooks/spreadsheet")
"""Pages with wide tables or long lines of code."""


@pytest.fixture
def telephone() -> Iterator[tuple[Any, list[str]]]:
    """A page of 390 px, and a list of what went wrong on it."""
    wrong: list[str] = []
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[*QUIET, "--disable-sync"])
        page = browser.new_page(viewport={"width": 390, "height": 844})
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "console", lambda told: wrong.append(told.text) if told.type in ("error", "warning") else None
        )
        page.on("request", lambda asked: None if asked.url.startswith("file:") else wrong.append(asked.url))
        yield page, wrong
        browser.close()


def test_search_works_from_the_disk(site: Path, telephone: tuple[Any, list[str]]) -> None:
    page, wrong = telephone
    page.goto((site / "index.html").as_uri())
    page.click("label[for=__search].md-header__button")
    page.locator(".md-search__input").press_sequentially("thalweg")
    page.wait_for_selector(".md-search-result__link")
    page.click(".md-search-result__link")
    page.wait_for_url("**/*.html?h=thalweg")
    assert wrong == []


@pytest.mark.parametrize("name", WIDE)
def test_no_page_is_wider_than_a_telephone(name: str, site: Path, telephone: tuple[Any, list[str]]) -> None:
    page, wrong = telephone
    page.goto((site / f"{name}.html").as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert wrong == []
