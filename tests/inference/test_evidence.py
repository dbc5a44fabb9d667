"""Evidence by sequential Monte Carlo against a sum over a grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pymc as pm
import pytest
from scipy.stats import multivariate_normal

from skred.inference.evidence import Evidence, evidence

TOLERANCE = {"pcm": 0.15, "constant": 0.15, "coulomb": 0.2}


@pytest.mark.slow
@pytest.mark.parametrize("law_id", list(TOLERANCE))
def test_evidence_is_that_of_the_grid(
    law_id: str, model_of: Callable[[str], Any], quadrature_of: Callable[[str], Any]
) -> None:
    found = evidence(model_of(law_id), [1, 2])
    exact = quadrature_of(law_id).log_evidence
    assert len(found.log_evidence) == 2 and found.log_evidence[0] != found.log_evidence[1]
    assert abs(found.mean - exact) < TOLERANCE[law_id], (found, exact)
    assert found.spread < 2 * TOLERANCE[law_id]


@pytest.mark.slow
def test_a_seed_reproduces(model_of: Callable[[str], Any]) -> None:
    first, again = (evidence(model_of("constant"), [5], draws=100) for _ in range(2))
    assert first == again


def test_mean_and_spread() -> None:
    found = Evidence((-10.0, -10.5, -9.5))
    assert found.mean == -10.0 and found.spread == 1.0


def test_evidence_of_a_normal_mean() -> None:
    """Known in closed form. With half of the seeds the two chains take different numbers of stages."""
    readings, sd, prior_sd = np.array([4.0, 4.3, 3.9, 4.4]), 0.05, 3.0
    with pm.Model() as model:
        mean = pm.Normal("mean", 0.0, prior_sd)
        pm.Normal("reading", mean, sd, observed=readings)
    exact = multivariate_normal(np.zeros(4), sd**2 * np.eye(4) + prior_sd**2).logpdf(readings)
    found = evidence(model, range(8), draws=60)
    assert np.abs(np.array(found.log_evidence) - exact).max() < 0.6
    assert found.mean == pytest.approx(exact, abs=0.2)
