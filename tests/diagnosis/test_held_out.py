"""Leaving events out by smoothed weights, against what is known in closed form, and against refits."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import logsumexp
from scipy.stats import norm

from skred.diagnosis.predict.held_out import leave_out_weights


@pytest.mark.parametrize("far", [0.0, 2.5])
def test_smoothed_weights_leave_an_event_out(far: float) -> None:
    """Normal readings of one mean: the predictive density of each by the others is known."""
    rng = np.random.default_rng(2)
    values = rng.standard_normal(12)
    values[0] = far
    n, total = len(values), values.sum()
    draws = total / n + rng.standard_normal(40_000) / np.sqrt(n)
    densities = norm.logpdf(values[None, :], draws[:, None], 1.0)
    log_weights, k = leave_out_weights(densities)
    weights = log_weights - logsumexp(log_weights, axis=0)
    found = logsumexp(densities + weights, axis=0)
    others = (total - values) / (n - 1)
    exact = norm.logpdf(values, others, np.sqrt(1.0 + 1.0 / (n - 1)))
    assert_allclose(found, exact, atol=0.03)
    assert k.max() < 0.7
    assert_allclose(np.exp(weights).T @ draws, others, atol=0.03)
