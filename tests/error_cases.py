"""Errors of readings by scipy alone: another route to what `ErrorModel.draw` draws."""

from __future__ import annotations

import numpy as np
from scipy import stats


def standardised_errors(name: str, is_velocity: np.ndarray, n: int, rng: np.random.Generator) -> np.ndarray:
    """Errors of n avalanches in stated standard deviations, (n, n_sensors), as the model's title says."""
    shape = (n, len(is_velocity))
    normal = stats.norm.rvs(size=shape, random_state=rng)
    if name == "normal":
        return normal
    if name == "student":
        return np.asarray(stats.t.rvs(4, size=shape, random_state=rng))
    if name == "scaled":
        return normal * stats.lognorm.rvs(0.5, size=(n, 1), random_state=rng)
    if name == "correlated":
        velocities = np.outer(is_velocity, is_velocity)
        covariance = np.where(velocities, 0.5, 0.0) + np.diag(np.where(is_velocity, 0.5, 1.0))
        return np.asarray(stats.multivariate_normal.rvs(cov=covariance, size=n, random_state=rng))
    assert name == "robust"
    share = np.where(rng.random((n, 1)) < 0.5, 0.002, 0.02)
    return np.where(rng.random(shape) < share, 6.0 * normal, normal)


def within_binomial_limits(covered: np.ndarray, share: float = 0.9) -> bool:
    """Whether a share of independent cases is what it should be, but for one test in ten thousand."""
    low, high = stats.binom.interval(1.0 - 1e-4, len(covered), share)
    return bool(low <= covered.sum() <= high)
