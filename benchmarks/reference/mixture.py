"""Student t mixtures as proposals: draws, and densities."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

FloatArray = NDArray[np.float64]
_DEGREES = 5.0


class Mixture(NamedTuple):
    """Student t densities around centres.

    Attributes
    ----------
    weights : (k,) array
    centres : (k, n) array
    factors : (k, n, n) array
        Lower triangular.
    """

    weights: FloatArray
    centres: FloatArray
    factors: FloatArray

    def draw(self, size: int, rng: np.random.Generator) -> FloatArray:
        """Draws, (size, n)."""
        which = rng.choice(len(self.weights), size=size, p=self.weights)
        normal = rng.standard_normal((size, self.centres.shape[1]))
        stretch = np.sqrt(_DEGREES / rng.chisquare(_DEGREES, size))
        return np.asarray(
            self.centres[which] + stretch[:, None] * np.einsum("kij,kj->ki", self.factors[which], normal)
        )

    def log_density(self, points: FloatArray) -> FloatArray:
        """At points, (m, n) to (m,)."""
        n = points.shape[1]
        constant = float(gammaln(0.5 * (_DEGREES + n)) - gammaln(0.5 * _DEGREES))
        constant -= 0.5 * n * math.log(_DEGREES * math.pi)
        total = np.full(len(points), -np.inf)
        for weight, centre, factor in zip(self.weights, self.centres, self.factors, strict=True):
            white = (points - centre) @ np.linalg.inv(factor).T
            own = constant + math.log(weight) - float(np.log(np.diag(factor)).sum())
            own = own - 0.5 * (_DEGREES + n) * np.log1p(np.sum(white**2, axis=1) / _DEGREES)
            total = np.logaddexp(total, own)
        return total


def around(
    points: FloatArray, weights: FloatArray, n_local: int, rng: np.random.Generator, wider: float = 1.25
) -> Mixture:
    """A mixture that follows weighted points: one wide density, and a kernel around some of them.

    Parameters
    ----------
    weights : (n_points,) array
        Sum to 1.
    """
    n = points.shape[1]
    effective = 1.0 / float(np.sum(weights**2))
    mean = weights @ points
    away = points - mean
    covariance = (weights * away.T) @ away + 1e-10 * np.eye(n)
    factor = np.linalg.cholesky(covariance)
    bandwidth = (4.0 / ((n + 2) * min(effective, 8.0 * n_local))) ** (1.0 / (n + 4))
    steps = (np.arange(n_local) + rng.random()) / n_local
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), steps), len(points) - 1)
    centres = np.vstack([mean[None], points[chosen]])
    factors = np.concatenate([(wider * factor)[None], np.tile(1.1 * bandwidth * factor, (n_local, 1, 1))])
    shares = np.concatenate([[0.4], np.full(n_local, 0.6 / n_local)])
    return Mixture(shares, centres, factors)
