"""Compilation of the likelihoods; see `skred.parallel.compile_cache`."""

from __future__ import annotations

from pathlib import Path

from skred.parallel.compile_cache import compiled, stamp_room
from skred.physics.kernel.compiled import KERNEL_FINGERPRINT

__all__ = ["INFERENCE_CACHE_KEY", "INFERENCE_FINGERPRINT", "compiled"]

INFERENCE_FINGERPRINT = stamp_room(Path(__file__).resolve().parent, KERNEL_FINGERPRINT)
"""Of the likelihoods' source, the kernel's included."""
INFERENCE_CACHE_KEY = int(INFERENCE_FINGERPRINT[:12], 16)
"""Under which PyTensor caches compiled callers."""
