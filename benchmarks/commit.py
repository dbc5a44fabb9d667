"""By which code a benchmark's figures are."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def commit() -> str:
    """The commit of the checkout, and whether the code was changed since."""
    changed = _git("status", "--porcelain", "--", "src", "models", "benchmarks/*.py")
    return _git("describe", "--always") + ("-changed" if changed else "")


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
