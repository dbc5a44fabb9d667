"""Adaptive importance sampling against integrals that are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import skewnorm

from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode, weighted_draws

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


@pytest.mark.parametrize("size", [2, 5, 8])
def test_a_skewed_density_from_a_proposal_that_is_off_and_too_narrow(size: int) -> None:
    """The stated errors are those that are made, and adaptation takes no weight from what is counted."""
    rng = np.random.default_rng(9)
    factor = rng.standard_normal((size, size)) / np.sqrt(size) + 0.5 * np.eye(size)
    log_volume = float(np.linalg.slogdet(factor)[1])

    def log_density(draws: FloatArray) -> FloatArray:
        white = np.linalg.solve(factor, draws.T).T
        return np.asarray(skewnorm.logpdf(white, 3.0).sum(axis=1) - log_volume + 2.0)

    near = Mixture.on([Mode(0.5 * factor.sum(axis=1), 0.7 * factor @ factor.T)])
    found = [weighted_draws(log_density, near, np.random.default_rng(seed)) for seed in range(24)]
    values = np.array([one.log_integral for one in found])
    stated = float(np.mean([one.error for one in found]))
    assert all(one.error < 0.1 for one in found)
    assert values.mean() == pytest.approx(2.0, abs=3.5 * values.std() / np.sqrt(len(values)))
    assert 0.6 * stated < values.std() < 1.6 * stated


def test_a_force_of_many_values_loses_little_to_adaptation() -> None:
    """By few draws in 32 dimensions, a fifth of a width off along each: by the mixture's weights 0.2."""
    size = 32

    def log_density(draws: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * np.sum(draws**2, axis=1) - 0.5 * size * np.log(2.0 * np.pi))

    near = Mixture.on([Mode(0.2 * np.ones(size), 0.9 * np.eye(size))])
    found = [
        weighted_draws(log_density, near, np.random.default_rng(seed), 64, 0.2).log_integral
        for seed in range(60)
    ]
    assert np.mean(found) == pytest.approx(0.0, abs=0.12)


def test_proposals_of_any_size_of_numbers() -> None:
    """Variances of 1e-12 beside those of 1e4: what keeps factors regular depends on neither."""
    scales = np.array([1e-6, 1e2])

    def log_density(draws: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * np.sum((draws / scales) ** 2, axis=1) - np.log(2.0 * np.pi * scales.prod()))

    for own in (scales, scales[:1]):
        density = log_density if len(own) == 2 else _of_one(own[0])
        found = weighted_draws(
            density, Mixture.on([Mode(np.zeros(len(own)), np.diag(own**2))]), np.random.default_rng(0)
        )
        assert found.error < 0.05
        assert found.log_integral == pytest.approx(0.0, abs=4.0 * found.error)


def _of_one(scale: float) -> Any:
    return lambda draws: -0.5 * (draws[:, 0] / scale) ** 2 - 0.5 * np.log(2.0 * np.pi * scale**2)


def test_draws_of_a_density_that_is_nowhere_are_refused() -> None:
    proposal = Mixture.on([Mode(np.zeros(2), np.eye(2))])
    found = weighted_draws(lambda draws: np.full(len(draws), np.nan), proposal, np.random.default_rng(0))
    assert found.log_integral == -np.inf
    with pytest.raises(np.linalg.LinAlgError, match="nothing is found"):
        found.resampled(3, np.random.default_rng(0))
