"""Which files a track was made from, and by what."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Any

LARGEST_HASHED_BYTES = 500_000_000
"""Of a larger file no hash is made: reading it would take longer than everything else."""


def of_file(file: Path) -> dict[str, Any]:
    """Name, size and hash of a file.

    Parameters
    ----------
    file : Path

    Returns
    -------
    dict
        ``file``, ``bytes``, and ``sha256``, which is None for a very large file.
    """
    size = file.stat().st_size
    digest = None
    if size <= LARGEST_HASHED_BYTES:
        with file.open("rb") as opened:
            digest = hashlib.file_digest(opened, "sha256").hexdigest()
    return {"file": file.name, "bytes": size, "sha256": digest}


def of_skred() -> str:
    """The version of this program."""
    return version("skred")
