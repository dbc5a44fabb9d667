"""Compilation of the diagnosis; see `skred.compiled`."""

from __future__ import annotations

from pathlib import Path

from skred.compiled import compiled, stamp_room
from skred.inference.compiled import INFERENCE_FINGERPRINT

__all__ = ["DIAGNOSIS_CACHE_KEY", "compiled"]

DIAGNOSIS_CACHE_KEY = int(stamp_room(Path(__file__).resolve().parent, INFERENCE_FINGERPRINT)[:12], 16)
"""Under which PyTensor caches compiled callers."""
