"""Where the table of a track comes from: the file as it is, and what ``skred track`` wrote beside it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skred.campaign import Track
from skred.documents import MOST_BYTES

_TOLERANCE_M = 1e-3
"""Within which a table has the points that its document says."""


def track_origin(file: Path, track: Track) -> dict[str, Any]:
    """SHA-256 of a track's file, and terrain model, line and reference system where they are known.

    Parameters
    ----------
    file : Path
        The table.
    track : Track
        Its points.

    Returns
    -------
    dict
        ``file`` and ``sha256``; ``made_from`` with ``terrain``, ``line`` and ``reference_system``, or None
        where no document of this track lies beside it.
    """
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return {"file": file.name, "sha256": digest, "made_from": _made_from(file.with_suffix(".json"), track)}


def _made_from(file: Path, track: Track) -> dict[str, Any] | None:
    """Of the document beside a table, if it is one of this track."""
    try:
        if file.stat().st_size > MOST_BYTES:
            return None
        document = json.loads(file.read_bytes())
        profile, terrain, line = (document[name] for name in ("profile", "terrain", "line"))
        same = all(
            np.shape(profile[name]) == of.shape
            and np.allclose(profile[name], of, rtol=0.0, atol=_TOLERANCE_M)
            for name, of in (("x_m", track.x_m), ("z_m", track.z_m))
        )
        if not same:
            return None
        return {
            "terrain": _file(terrain),
            "line": _file(line) | {"name": None if line["name"] is None else str(line["name"])},
            "reference_system": terrain["reference_system"] and str(terrain["reference_system"]),
        }
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _file(of: Mapping[str, Any]) -> dict[str, Any]:
    return {key: None if of[key] is None else str(of[key]) for key in ("file", "sha256")}
