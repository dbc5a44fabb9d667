"""Evidence by sequential Monte Carlo against a sum over a grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from skred.inference.evidence import Evidence, _log_evidence, evidence

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


def test_a_seed_reproduces(model_of: Callable[[str], Any]) -> None:
    first, again = (evidence(model_of("constant"), [5], draws=100) for _ in range(2))
    assert first == again


def test_mean_and_spread() -> None:
    found = Evidence((-10.0, -10.5, -9.5))
    assert found.mean == -10.0 and found.spread == 1.0


def test_last_finite_value_of_padded_chains_averaged_as_evidence() -> None:
    """PyMC pads with NaN, in arrays of objects."""
    padded = np.empty((2, 3), dtype=object)
    for chain, last in enumerate((-5.0, -7.0)):
        padded[chain] = [-1.0, np.array([-2.0, last]), np.nan]
    expected = np.log(0.5 * (np.exp(-5.0) + np.exp(-7.0)))
    assert _log_evidence(padded) == pytest.approx(expected)
