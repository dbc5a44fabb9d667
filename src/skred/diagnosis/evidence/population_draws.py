"""Populations drawn from the posterior of a calibration."""

from __future__ import annotations

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import Population
from skred.inference.calibrate import Calibration, posterior_of
from skred.inference.hierarchical.population import population_of

_DRAWS = 500
"""Populations drawn: their middle is known to a twentieth of how they scatter."""


def population_draws(calibration: Calibration, seed: int) -> tuple[FloatArray, FloatArray]:
    """Means and factors of populations from a posterior, drawn at random without replacement.

    Returns
    -------
    means : (n, n_base) array
    factors : (n, n_base, n_base) array
        Lower Cholesky factors of the covariances.
    """
    means, factors = population_of(calibration.law, posterior_of(calibration))
    n = min(_DRAWS, len(means))
    chosen = np.random.default_rng([seed, 41]).choice(len(means), size=n, replace=False)
    return means[chosen], factors[chosen]


def typical(draws: tuple[FloatArray, FloatArray]) -> Population:
    """Roughly the middle of a posterior of populations."""
    means, factors = draws
    covariance = np.einsum("gij,gkj->gik", factors, factors)
    return Population(means.mean(axis=0)[None], np.median(covariance, axis=0)[None])
