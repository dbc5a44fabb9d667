"""By which code a benchmark's figures are."""

import subprocess
from pathlib import Path


def commit() -> str:
    """The commit of the checkout, and whether it was changed since."""
    command = ["git", "-C", str(Path(__file__).resolve().parent), "describe", "--always", "--dirty"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
