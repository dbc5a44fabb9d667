"""Links and headings of pages of Markdown, as MkDocs and the usual hosts of code number them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "benchmarks/README.md", "studies/README.md")),
    *sorted(DOCS.glob("*.md")),
    *sorted(DOCS.glob("notebooks/*.py")),
]
"""All that is read by people."""
ISSUES = "../../issues"
"""Seen from the README, where the usual hosts of code have the issues of whatever repository it lies in."""


def text_of(page: Path) -> str:
    """Markdown of a page; of a notebook that of its cells of text. Blocks of code are left out."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        cells = re.findall(r"^# %% \[markdown\]\n((?:#.*\n?)+)", text, re.M)
        text = "\n\n".join(re.sub(r"^# ?", "", cell, flags=re.M) for cell in cells)
    return re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)


def links_of(text: str) -> list[str]:
    """Targets of all links and figures."""
    return re.findall(r"\]\(([^)\s]+)\)", text)


def anchors_of(text: str) -> set[str]:
    """What the headings can be linked by."""
    heads = [re.sub(r"[*`]|\]\([^)]*\)", "", head) for head in re.findall(r"^#+ (.+)$", text, re.M)]
    return {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}


def is_external(target: str) -> bool:
    """Whether another host has it."""
    return re.match(r"[a-z]+:", target) is not None


def problems_of(page: Path, text: str) -> list[str]:
    """Links of a page that lead nowhere."""
    found = []
    for target in links_of(text):
        if is_external(target) or target == ISSUES:
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        if not file.is_file():
            found.append(f"{target}: no such file")
        elif anchor and anchor not in anchors_of(text_of(file) if name else text):
            found.append(f"{target}: no such heading")
    return found
