"""Compilation of ring 1; see `skred.parallel.compile_cache`."""

from __future__ import annotations

from pathlib import Path

from skred.parallel.compile_cache import compiled, stamp_room

__all__ = ["KERNEL_FINGERPRINT", "compiled"]

KERNEL_FINGERPRINT = stamp_room(Path(__file__).resolve().parent)
"""Of the kernel's source: what calls it is cached under it as well."""
