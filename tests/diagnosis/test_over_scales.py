"""A strength's prior of three scales, where the widest alone was fitted under: against the trapezium rule."""

from __future__ import annotations

import numpy as np
import pytest

from skred.diagnosis.evidence.over_scales import log_over_scales, moments_over_scales
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.spec import Direction, Shape
from skred.physics.mechanisms.strength_prior import log_prior_density


def placed(name: str) -> PlacedMechanism:
    return PlacedMechanism(mechanisms()[name], Shape(), Direction())


@pytest.mark.parametrize("name", ["segment_drag", "segment_friction"])
@pytest.mark.parametrize("top", [-1.0, 0.0, 0.4, 1.5, 6.0])
@pytest.mark.parametrize("sd", [0.2, 1.0, 5.0])
def test_against_the_trapezium_rule(name: str, top: float, sd: float) -> None:
    """A normal likelihood around `top`, in scales of the mechanism."""
    one = placed(name)
    either, wide = one.added.either_sign, one.widest / one.scale
    variance = 1.0 / (sd**-2.0 + wide**-2.0)
    mean = variance * top / sd**2
    given = mean * one.scale, variance * one.scale**2, one
    x = np.linspace(-60.0 if either else 0.0, 60.0, 400_001)
    log_likelihood = -0.5 * ((x - top) / sd) ** 2
    whole = np.exp(log_likelihood + log_prior_density(x, 1.0, either_sign=either))
    both = np.linspace(-60.0, 60.0, 400_001)
    under_widest = np.exp(-0.5 * ((both - top) / sd) ** 2 - 0.5 * (both / wide) ** 2) / wide
    expected = np.log(np.trapezoid(whole, x))
    expected -= np.log(np.trapezoid(under_widest, both) / np.sqrt(2.0 * np.pi))
    assert log_over_scales(*given) == pytest.approx(expected, abs=1e-4)
    share = whole / np.trapezoid(whole, x)
    middle = np.trapezoid(share * x, x)
    found_mean, found_sd = moments_over_scales(*given)
    assert found_mean / one.scale == pytest.approx(middle, abs=1e-4)
    assert found_sd / one.scale == pytest.approx(np.trapezoid(share * (x - middle) ** 2, x) ** 0.5, rel=1e-4)


def test_far_below_nil_there_is_no_float_of_its_share() -> None:
    one = placed("segment_drag")
    given = -60.0 * one.scale, 4.0 * one.scale**2, one
    log_factor, (mean, sd) = log_over_scales(*given), moments_over_scales(*given)
    assert np.isfinite(log_factor) and log_factor < -100.0
    assert 0.0 < mean < one.scale and 0.0 < sd < one.scale
