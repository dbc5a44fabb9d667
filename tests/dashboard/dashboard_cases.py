"""What tests of the dashboard share. They are skipped where the extra `dashboard` is not installed."""

from __future__ import annotations

import shutil
from typing import Any

import pytest

WHY = "the extra dashboard is not installed"
bokeh = pytest.importorskip("bokeh", reason=WHY)
panel = pytest.importorskip("panel", reason=WHY)
playwright = pytest.importorskip("playwright", reason="playwright is not installed")

EVIL = "<img src=x onerror=document.body.dataset.attacked=1>"
NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")


def named(given: Any, start: str) -> Any:
    """The run whose title starts so."""
    return next(run for run in given.runs if run.title.startswith(start))
