"""The site, built once for all tests that look at it."""

from __future__ import annotations

from pathlib import Path

import pytest
from built_site import ROOT, build


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as it is built, but for what notebooks put out."""
    pytest.importorskip("mkdocs", reason="the group `site` is not installed: uv run --group site pytest")
    folder = tmp_path_factory.mktemp("built") / "site"
    done = build(ROOT / "mkdocs.yml", folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder
