"""The library of mechanisms: one file each, found by being there."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from skred.physics.mechanisms.spec import Mechanism, Strength

__all__ = ["Mechanism", "Strength", "mechanisms"]

_NOT_MECHANISMS = ("spec", "stretches")


@cache
def mechanisms() -> dict[str, Mechanism]:
    """All mechanisms by id: the constant ``MECHANISM`` of every module in this folder."""
    found = {}
    for module in iter_modules(__path__):
        if module.name not in _NOT_MECHANISMS:
            mechanism: Mechanism = import_module(f"{__name__}.{module.name}").MECHANISM
            found[mechanism.id] = mechanism
    return found
