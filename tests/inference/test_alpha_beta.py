"""The alpha-beta model on a parabola, where everything has a closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from skred.inference.alpha_beta import AlphaBeta, alpha_beta

STEEPNESS, BOTTOM = 4e-4, 1000.0
"""z = STEEPNESS (BOTTOM - x)^2 [1/m, m]."""


def parabola(end: float = 1500.0, step: float = 0.5) -> AlphaBeta:
    x = np.arange(0.0, end + step / 2, step)
    return alpha_beta(x, STEEPNESS * (BOTTOM - x) ** 2, np.arctan(2 * STEEPNESS * (BOTTOM - x)))


def arc_length(x: float) -> float:
    def primitive(m: float) -> float:
        return (m * math.hypot(1, m) + math.asinh(m)) / (4 * STEEPNESS)

    return primitive(2 * STEEPNESS * BOTTOM) - primitive(2 * STEEPNESS * (BOTTOM - x))


def runout_x(alpha_deg: float) -> float:
    """The sight line from the top to x falls at tan = STEEPNESS (2 BOTTOM - x)."""
    return 2 * BOTTOM - math.tan(math.radians(alpha_deg)) / STEEPNESS


def test_beta_and_runout_on_a_parabola() -> None:
    model = parabola()
    beta_x = BOTTOM - math.tan(math.radians(10)) / (2 * STEEPNESS)
    assert_allclose(model.beta_s_m, arc_length(beta_x), rtol=1e-6)
    beta = math.degrees(math.atan(STEEPNESS * (2 * BOTTOM - beta_x)))
    assert_allclose(model.beta_deg, beta, rtol=1e-6)
    assert_allclose(model.alpha_deg, 0.96 * beta - 1.4, rtol=1e-6)
    for alpha in (model.alpha_deg, model.alpha_deg - 2.3, beta + 4.0):
        assert_allclose(model.runout_s_m(alpha), arc_length(runout_x(alpha)), rtol=1e-6)
    assert_allclose(model.runout_s_m(reference_s_m=900.0), model.runout_s_m() - 900.0)


def test_probabilities_follow_alpha() -> None:
    model = parabola()
    for z in (-2.0, -1.0, 0.0, 1.0, 2.0):
        s = model.runout_s_m(model.alpha_deg + 2.3 * z)
        assert_allclose(model.exceedance_probability(s), norm.cdf(z), rtol=1e-5)
        assert_allclose(model.runout_quantile_s_m(norm.cdf(z)), s, rtol=1e-9)
    assert math.isnan(model.exceedance_probability(model.s_m[-1] + 1))


def test_lines_that_do_not_meet_the_track_are_values() -> None:
    model = parabola(end=1050.0)
    assert model.runout_s_m(model.alpha_deg - 3.0) == math.inf
    assert math.isnan(model.runout_s_m(60.0))
    assert model.runout_quantile_s_m(1e-3) == math.inf
    assert 0 < model.exceedance_probability(model.s_m[-1]) < 1


def test_counter_slope_stops_every_later_crossing() -> None:
    # A bump just below the beta point hides the ground behind it from flatter lines.
    x = np.array([0.0, 500.0, 1000.0, 1100.0, 1200.0, 3000.0])
    z = np.array([600.0, 250.0, 100.0, 130.0, 60.0, 0.0])
    model = alpha_beta(x, z, np.radians([35.0, 30.0, 9.0, -5.0, 9.0, 1.0]))
    bump = model.angle_of_sight_deg(model.s_m[3])
    assert model.runout_s_m(bump + 0.01) < model.s_m[3]
    assert model.runout_s_m(bump - 0.01) > model.s_m[4]
    assert model.exceedance_probability(model.s_m[4]) <= model.exceedance_probability(model.s_m[3])


def test_track_without_beta_point_is_refused() -> None:
    x = np.linspace(0, 1000, 11)
    with pytest.raises(ValueError, match="never falls"):
        alpha_beta(x, -0.5 * x, np.full(11, math.atan(0.5)))
    with pytest.raises(ValueError, match="never falls"):
        alpha_beta(x, -0.05 * x, np.full(11, math.atan(0.05)))
    with pytest.raises(ValueError, match="equally long"):
        alpha_beta(x, x[1:], x)
    with pytest.raises(ValueError, match="must increase"):
        alpha_beta(-x, x, x)
