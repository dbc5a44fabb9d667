"""The PyMC model of the pooled calibration is the problem's density and its priors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import halfnorm

from skred.physics.laws import load_law

LAW = load_law("pcm")
POINTS = np.array([[0.28, 0.0023], [0.2, 0.004], [0.6, 0.001], [0.05, 0.0002], [2.0, 0.01]])


def values_at(point: np.ndarray) -> dict[str, Any]:
    return {
        f"{name}_log__": np.array(np.log(value))
        for name, value in zip(LAW.parameter_names, point, strict=True)
    }


@pytest.mark.parametrize("where", ["problem", "two_releases"])
def test_model_is_the_problems_density(
    where: str, request: pytest.FixtureRequest, model_of: Callable[[str], Any]
) -> None:
    problem = request.getfixturevalue(where)
    model = model_of("pcm") if where == "problem" else LAW.build(problem)
    logp = model.compile_logp(vars=model["recordings"], sum=False)
    for point in POINTS:
        expected = problem.log_density(LAW.mechanisms, point[None])[0]
        assert_allclose(logp(values_at(point))[0], expected, rtol=1e-10)


def test_priors_and_their_transform(problem: Any, model_of: Callable[[str], Any]) -> None:
    logp = model_of("pcm").compile_logp()
    scales = [mechanism.strength.prior_scale for mechanism in LAW.mechanisms]
    for point in POINTS:
        prior = halfnorm.logpdf(point, scale=scales).sum() + np.log(point).sum()
        likelihood = problem.log_density(LAW.mechanisms, point[None]).sum()
        assert_allclose(logp(values_at(point)), prior + likelihood, rtol=1e-10)


def test_gradient_against_differences(model_of: Callable[[str], Any]) -> None:
    """Away from the kinks; the Op's own gradient is tested against complex steps."""
    model = model_of("pcm")
    logp, gradient = model.compile_logp(), model.compile_dlogp()
    q, step = np.log(POINTS[0]), 1e-5

    def at(q: np.ndarray) -> float:
        return float(logp(values_at(np.exp(q))))

    numeric = [(at(q + step * unit) - at(q - step * unit)) / (2 * step) for unit in np.eye(2)]
    assert_allclose(gradient(values_at(POINTS[0])), numeric, rtol=1e-5)
