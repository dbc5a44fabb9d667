"""The prior of a population, written a second time: as a transform of the unit cube, and as a density.

Coordinates psi: means of the log coefficients, logarithms of their spreads, inverse hyperbolic tangents of
the partial correlations. The median of a coefficient is half-normal, a spread log-normal, correlations are
LKJ. `tests/benchmarks` compares transform and density, and the density with that of the diagnosis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, betaln, ndtri

from skred.inference.hierarchical.population import LKJ_SHAPE
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN

FloatArray = NDArray[np.float64]
_LOG_SQRT_2PI = 0.5 * np.log(2.0 * np.pi)
_EDGE = 1e-12


def n_coordinates(n: int) -> int:
    """Number of coordinates of a population of `n` coefficients."""
    return 2 * n + n * (n - 1) // 2


def _shapes(n: int) -> FloatArray:
    """Shape of the beta distribution of each partial correlation: pairs (0, 1), (0, 2), ..., (1, 2), ..."""
    return np.array([LKJ_SHAPE + 0.5 * (n - 2 - j) for j in range(n) for _ in range(j + 1, n)])


def from_cube(cube: FloatArray, log_scale: FloatArray) -> FloatArray:
    """Coordinates of populations whose prior is uniform on the cube, (..., n_psi) both."""
    n = len(log_scale)
    u = np.clip(np.asarray(cube, dtype=float), _EDGE, 1.0 - _EDGE)
    psi = np.empty_like(u)
    psi[..., :n] = log_scale + np.log(ndtri(0.5 + 0.5 * u[..., :n]))
    psi[..., n : 2 * n] = np.log(SPREAD_MEDIAN) + SPREAD_LOG_SD * ndtri(u[..., n : 2 * n])
    if n > 1:
        shapes = _shapes(n)
        psi[..., 2 * n :] = np.arctanh(2.0 * betaincinv(shapes, shapes, u[..., 2 * n :]) - 1.0)
    return psi


def log_prior(psi: FloatArray, log_scale: FloatArray) -> FloatArray:
    """Log density in these coordinates, normalised, (..., n_psi) to (...)."""
    n = len(log_scale)
    z = psi[..., :n] - log_scale
    total = np.sum(0.5 * np.log(2.0 / np.pi) - 0.5 * np.exp(2.0 * z) + z, axis=-1)
    z = (psi[..., n : 2 * n] - np.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD
    total = total + np.sum(-0.5 * z**2 - np.log(SPREAD_LOG_SD) - _LOG_SQRT_2PI, axis=-1)
    if n > 1:
        # (1 + r) / 2 is beta; d(r)/d(atanh r) = 1 - r^2 = 4 b (1 - b), of which a half each is d(b).
        shapes = _shapes(n)
        log_b = -np.log1p(np.exp(-2.0 * psi[..., 2 * n :]))
        log_1b = -np.log1p(np.exp(2.0 * psi[..., 2 * n :]))
        each = shapes * (log_b + log_1b) - betaln(shapes, shapes) + np.log(2.0)
        total = total + each.sum(axis=-1)
    return np.asarray(total)


def covariance_of(psi: FloatArray, n: int) -> FloatArray:
    """Covariances of the log coefficients, (n_psi_vectors, n, n)."""
    factors = factors_of(psi, n)
    return np.asarray(factors @ factors.transpose(0, 2, 1))


def factors_of(psi: FloatArray, n: int) -> FloatArray:
    """Lower Cholesky factors of the covariances."""
    factors = np.zeros((len(psi), n, n))
    for i in range(n):
        left = np.exp(psi[:, n + i])
        for j in range(i):
            r = np.tanh(psi[:, 2 * n + j * n - j * (j + 1) // 2 + i - j - 1])
            factors[:, i, j] = left * r
            left = left * np.sqrt(np.maximum(1.0 - r * r, 1e-12))
        factors[:, i, i] = left
    return factors
