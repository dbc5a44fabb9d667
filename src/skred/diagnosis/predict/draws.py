"""What the other avalanches say of one: draws of the population, and of the coefficients of what is added."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.evidence.extension import Extension

FloatArray = NDArray[np.float64]


class Draws(NamedTuple):
    """Draws of populations, and of the strengths of what is added, (n_draws, ...)."""

    means: FloatArray
    factors: FloatArray
    strengths: FloatArray

    def take(self, chosen: NDArray[np.int64]) -> Draws:
        """Some of them, perhaps repeated."""
        return Draws(*(values[chosen] for values in self))


class LeftOut(NamedTuple):
    """What a law says of an avalanche by the others.

    Attributes
    ----------
    extension : Extension
        The law with what is added to it.
    draws : Draws
        Of the posterior without the avalanche, all of the same weight.
    """

    extension: Extension
    draws: Draws
