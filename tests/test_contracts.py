"""The rooms import only what they may, and the package is light to import."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

CONFIGURATION = Path(__file__).resolve().parent.parent / "pyproject.toml"
HEAVY = {"pytensor", "pymc", "arviz", "xarray", "pandas", "matplotlib", "numpy", "numba", "scipy"}


def test_contracts_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    """Those of ``[tool.importlinter]``: ``lint-imports`` says which is broken, and how."""
    code = lint_imports(config_filename=str(CONFIGURATION), no_cache=True)
    assert code == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_importing_the_package_is_light() -> None:
    script = "import skred, sys; print(*{name.partition('.')[0] for name in sys.modules})"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert not set(output.split()) & HEAVY
