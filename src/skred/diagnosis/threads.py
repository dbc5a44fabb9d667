"""How many threads a diagnosis may take."""

from __future__ import annotations

import os


def threads() -> int:
    """As many as OMP_NUM_THREADS allows, which `skred prove` sets for its trials; all cores without it."""
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return int(allowed) if allowed.isdecimal() and int(allowed) > 0 else os.cpu_count() or 1
