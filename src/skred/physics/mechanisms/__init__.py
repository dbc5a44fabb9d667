"""Mechanisms: what may brake a front, and what may make it seem so. One file each, here or elsewhere."""

from skred.physics.mechanisms.library import library, mechanisms
from skred.physics.mechanisms.spec import Mechanism, Strength

__all__ = ["Mechanism", "Strength", "library", "mechanisms"]
