"""The prior of an added strength: its mass, its median, and single scales against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.stats import halfnorm, norm

from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.strength_prior import MEDIAN, SCALES, log_prior_density


@pytest.mark.parametrize("either_sign", [False, True])
def test_it_is_the_mean_of_scipys_densities(either_sign: bool) -> None:
    x, scale = np.linspace(0.0, 20.0, 41), 1.7
    family = norm if either_sign else halfnorm
    expected = np.mean([family.pdf(x, scale=part * scale) for part in SCALES], axis=0)
    found = log_prior_density(x, scale, either_sign=either_sign)
    assert np.exp(found) == pytest.approx(expected, rel=1e-10)
    one = log_prior_density(x, scale, either_sign=either_sign, scales=(0.5,))
    assert np.exp(one) == pytest.approx(family.pdf(x, scale=0.5 * scale), rel=1e-10)


def test_median_of_the_size() -> None:
    x = np.linspace(0.0, MEDIAN, 20_001)
    assert trapezoid(np.exp(log_prior_density(x, 1.0, either_sign=False)), x) == pytest.approx(0.5, abs=1e-4)
    for mechanism in mechanisms().values():
        added = added_of(mechanism)
        assert added.relevant == MEDIAN * added.scale


def test_six_scales_cost_less_than_five_nats() -> None:
    at_nil, far = log_prior_density(np.array([0.0, 6.0]), 1.0, either_sign=False)
    assert at_nil - far < 5.0
    at_nil, far = log_prior_density(np.array([0.0, 6.0]), 1.0, either_sign=False, scales=(1.0,))
    assert at_nil - far == pytest.approx(18.0)
