"""Compilation of the diagnosis; see `skred.parallel.compile_cache`."""

from __future__ import annotations

from pathlib import Path

from skred.inference.compiled import INFERENCE_FINGERPRINT
from skred.parallel.compile_cache import compiled, stamp_room

__all__ = ["DIAGNOSIS_CACHE_KEY", "compiled"]

DIAGNOSIS_CACHE_KEY = int(stamp_room(Path(__file__).resolve().parent, INFERENCE_FINGERPRINT)[:12], 16)
"""Under which PyTensor caches compiled callers."""
