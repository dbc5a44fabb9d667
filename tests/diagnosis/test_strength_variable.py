"""The added strength as a variable of a PyMC model: its density and its draws, between two values."""

from __future__ import annotations

import numpy as np
import pymc as pm
import pytest
from scipy.stats import kstest

from skred.diagnosis.augment.added_strength import strength_variable
from skred.physics.mechanisms.strength_prior import log_prior_density


@pytest.mark.parametrize(("low", "high"), [(0.0, 30.0), (0.0, 1.5), (-4.0, 5.0), (2.0, 7.0)])
def test_it_is_the_prior_between_two_values(low: float, high: float) -> None:
    """With what is outside left out; 30 scales hold all of it."""
    scale = 0.8
    with pm.Model() as model:
        strength = strength_variable("strength", scale, scale * low, scale * high)
    x = np.linspace(low, high, 4001)
    density = np.exp(log_prior_density(x, 1.0, either_sign=True))
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(x))])
    logp = model.compile_logp(jacobian=False)
    start, bijection = model.initial_point(), model.rvs_to_values[strength].name
    for at in np.linspace(low, high, 7)[1:-1]:
        unbounded = np.log((at - low) / (high - at))
        found = logp({**start, bijection: np.array(unbounded)})
        expected = np.interp(at, x, density) / mass[-1] / scale
        assert np.exp(found) == pytest.approx(expected, rel=1e-3)
    draws = pm.draw(strength, 2000, random_seed=3) / scale
    assert kstest(draws, lambda at: np.interp(at, x, mass / mass[-1])).pvalue > 0.01
