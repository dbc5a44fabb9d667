"""Importance sampling from a Student t density, whose heavy tails bound the weights."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

FloatArray = NDArray[np.float64]
_DEGREES = 5.0
"""Degrees of freedom of the proposals: tails heavy enough to bound the weights."""


class Weighted(NamedTuple):
    """Draws of a proposal.

    Attributes
    ----------
    draws : (n, size) array
    log_weights : (n,) array
        Log of the density over the proposal's.
    """

    draws: FloatArray
    log_weights: FloatArray

    @property
    def shares(self) -> FloatArray:
        """The weights, which sum to 1."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        result: FloatArray = weights / weights.sum()
        return result

    @property
    def log_integral(self) -> float:
        """Logarithm of the density's integral."""
        return float(np.logaddexp.reduce(self.log_weights)) - math.log(len(self.log_weights))

    @property
    def error(self) -> float:
        """Standard error of the log integral, in nats."""
        n = len(self.log_weights)
        return float(n * self.shares.std() / math.sqrt(n))

    def resampled(self, n: int, rng: np.random.Generator) -> FloatArray:
        """So many of the draws, by their weights."""
        return self.draws[rng.choice(len(self.draws), size=n, p=self.shares)]


def weighted_draws(
    log_density: Callable[[FloatArray], FloatArray],
    centre: FloatArray,
    factor: FloatArray,
    n: int,
    rng: np.random.Generator,
) -> Weighted:
    """Draws around a centre.

    Parameters
    ----------
    log_density : callable
        What is integrated: (n, size) to (n,); need not be normalised.
    centre : (size,) array
    factor : (size, size) array
        Lower triangular: the proposal's scale.
    """
    size = len(centre)
    white = rng.standard_normal((n, size))
    white *= np.sqrt(_DEGREES / rng.chisquare(_DEGREES, n))[:, None]
    draws = centre + white @ factor.T
    log_t = float(gammaln(0.5 * (_DEGREES + size)) - gammaln(0.5 * _DEGREES))
    log_t -= 0.5 * size * math.log(_DEGREES * math.pi) + float(np.log(np.diag(factor)).sum())
    log_q = log_t - 0.5 * (_DEGREES + size) * np.log1p(np.sum(white**2, axis=1) / _DEGREES)
    return Weighted(draws, np.nan_to_num(log_density(draws) - log_q, nan=-np.inf))
