"""The page of mechanisms: it is what the library says."""

from __future__ import annotations

import runpy
from pathlib import Path

from skred.physics.mechanisms import mechanisms

ROOT = Path(__file__).parents[2]


def test_page_is_what_the_script_makes_of_the_library() -> None:
    page = runpy.run_path(str(ROOT / "scripts" / "mechanisms.py"))["page"]()
    assert (ROOT / "docs" / "mechanisms.md").read_text(encoding="utf-8") == page


def test_every_mechanism_has_its_row_and_its_section() -> None:
    lines = (ROOT / "docs" / "mechanisms.md").read_text(encoding="utf-8").splitlines()
    for name, one in mechanisms().items():
        assert f"## {name}" in lines
        row = f"| [`{name}`](#{name}) | {one.title} | {one.equation} |"
        assert any(line.startswith(row) for line in lines)
