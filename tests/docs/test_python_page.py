"""The page of the Python surface: its session runs as written, and it names what there is."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

import skred

PAGE = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Estimated shape parameter")
def test_the_session_runs_as_written(capsys: pytest.CaptureFixture[str]) -> None:
    matplotlib.use("Agg")
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S))
    exec(compile(code, "python.md", "exec"), {})
    plt.close("all")
    told = capsys.readouterr().out
    assert "coulomb+turbulent_drag" in told
    assert "Priors were changed: of coulomb the scale of dry_friction 1." in told


def test_every_public_name_is_on_the_page() -> None:
    named = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`\n]+)`", PAGE))))
    assert set(skred.__all__) - {"Result"} <= named
