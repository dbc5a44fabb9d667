"""Curves of log evidence: exactly quadratic ones against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from skred.diagnosis.evidence.coefficient import Curve
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Direction, Shape


def quadratic(name: str, strengths: np.ndarray, top: float, sd: float) -> Curve:
    """log evidence(x) = -(x - top)^2 / (2 sd^2), relative to 0."""
    log_evidence = (top**2 - (strengths - top) ** 2) / (2.0 * sd**2)
    return Curve(mechanisms()[name], Shape(), Direction(), strengths, log_evidence, ())


def closed_form(top: float, sd: float, either_sign: bool) -> tuple[float, float, float]:
    """Log Bayes factor, posterior mean and standard deviation; everything in scales of the mechanism."""
    each = [of_one_scale(top, sd, scale, either_sign) for scale in (1.0 / 3.0, 1.0, 3.0)]
    factors, means, widths = (np.array(part) for part in zip(*each, strict=True))
    shares = np.exp(factors - factors.max()) / np.exp(factors - factors.max()).sum()
    mean = float(shares @ means)
    width = math.sqrt(float(shares @ (widths**2 + (means - mean) ** 2)))
    return float(np.logaddexp.reduce(factors)) - math.log(3.0), mean, width


def of_one_scale(top: float, sd: float, scale: float, either_sign: bool) -> tuple[float, float, float]:
    """The same with a prior of one scale."""
    precision = sd**-2.0 + scale**-2.0
    mean, width = top / sd**2 / precision, precision**-0.5
    factor = 0.5 * mean**2 * precision + math.log(width / scale)
    if either_sign:
        return factor, mean, width
    factor += math.log(2.0) + norm.logcdf(mean / width)
    posterior = truncnorm(-mean / width, np.inf, loc=mean, scale=width)
    return factor, float(posterior.mean()), float(posterior.std())


@pytest.mark.parametrize("top", [-0.8, 0.0, 0.3, 1.0, 1.9])
@pytest.mark.parametrize("sd", [0.3, 0.6, 1.5])
def test_half_normal(top: float, sd: float) -> None:
    """Strengths in scales of the prior, as close as curves have them where the posterior is."""
    scale = mechanisms()["segment_drag"].added.scale  # type: ignore[union-attr]
    grid = scale * np.concatenate([0.3 * np.arange(10), [3.5, 6.0, 10.0]])
    one = quadratic("segment_drag", grid, top * scale, sd * scale)
    factor, mean, width = closed_form(top, sd, False)
    assert one.log_bayes_factor == pytest.approx(factor, abs=0.1, rel=0.015)
    found = one.moments
    assert found[0] / scale == pytest.approx(mean, abs=0.06) and found[1] / scale == pytest.approx(
        width, rel=0.15
    )


@pytest.mark.parametrize("top", [-1.4, 0.0, 0.7])
@pytest.mark.parametrize("sd", [0.3, 0.8])
def test_normal(top: float, sd: float) -> None:
    scale = mechanisms()["sensor_bias"].added.scale  # type: ignore[union-attr]
    grid = np.concatenate([0.3 * np.arange(1, 10), [3.5, 6.0, 10.0]])
    one = quadratic(
        "sensor_bias", scale * np.concatenate([-grid[::-1], [0.0], grid]), top * scale, sd * scale
    )
    factor, mean, width = closed_form(top, sd, True)
    assert one.log_bayes_factor == pytest.approx(factor, abs=0.1, rel=0.015)
    found = one.moments
    assert found[0] / scale == pytest.approx(mean, abs=0.06) and found[1] / scale == pytest.approx(
        width, rel=0.15
    )


@pytest.mark.parametrize("either", [True, False])
def test_odd_spacing_around_what_was_found(either: bool) -> None:
    """As a second look spaces them: 0 far away, the rest within a few standard deviations of the top."""
    name = "sensor_bias" if either else "segment_drag"
    scale = mechanisms()[name].added.scale  # type: ignore[union-attr]
    top, sd = 1.3, 0.15
    near = scale * (top + sd * np.array([-3.5, -2.0, -1.0, 0.0, 1.0, 2.0, 3.5]))
    one = quadratic(name, np.append(0.0, near), top * scale, sd * scale)
    factor, mean, width = closed_form(top, sd, either)
    assert one.log_bayes_factor == pytest.approx(factor, abs=0.05)
    found = one.moments
    assert found[0] / scale == pytest.approx(mean, abs=0.02) and found[1] / scale == pytest.approx(
        width, rel=0.1
    )


def test_nothing_is_above_what_was_computed() -> None:
    """Two strengths that nearly coincide, of fits that differ: nats came from a slope between them."""
    drag = mechanisms()["segment_drag"]
    strengths = drag.added.scale * np.array([0.0, 0.3, 0.3093, 1.2])  # type: ignore[union-attr]
    one = Curve(drag, Shape(), Direction(), strengths, np.array([0.0, -3.9, -2.7, -21.2]), ())
    assert one.log_bayes_factor < 0.0


def test_nothing_to_see_is_nearly_even() -> None:
    """A flat curve says nothing: a Bayes factor of 1 but for the prior's tail beyond the grid."""
    side = np.array([0.2, 0.6, 1.2, 2.2, 3.5, 6.0, 12.0])
    one = quadratic("sensor_bias", 0.15 * np.concatenate([-side[::-1], [0.0], side]), 0.0, 1e9)
    assert one.log_bayes_factor == pytest.approx(0.0, abs=2e-3)
    assert one.moments[0] == pytest.approx(0.0, abs=1e-6)
    of_prior = math.sqrt((1.0 / 9.0 + 1.0 + 9.0) / 3.0)
    assert one.moments[1] == pytest.approx(0.15 * of_prior, rel=0.02)


def test_other_scales_of_the_prior() -> None:
    grid = 0.15 * np.array([-3.5, -2.2, -1.2, -0.6, -0.2, 0.0, 0.2, 0.6, 1.2, 2.2, 3.5])
    one = quadratic("sensor_bias", grid, 0.06, 0.08)
    for scale in (0.05, 0.1, 0.15):
        expected = of_one_scale(0.06, 0.08, scale, True)[0]
        assert one.log_factor_of(scales=(scale / 0.15,)) == pytest.approx(expected, abs=0.1)


def test_a_strong_effect_costs_little_and_an_ordinary_one_hardly_more() -> None:
    """Six scales of a mechanism: 13 nats less under one scale alone; around one scale less than 0.7 more."""
    for top, gains in ((0.5, -0.7), (1.0, -0.7), (2.0, -0.7), (3.0, 1.0), (6.0, 13.0)):
        scale = mechanisms()["segment_drag"].added.scale  # type: ignore[union-attr]
        near = scale * (top + 0.1 * np.array([-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0]))
        one = quadratic("segment_drag", np.append(0.0, near), top * scale, 0.1 * scale)
        gained = one.log_bayes_factor - one.log_factor_of(scales=(1.0,))
        assert gained > gains and (top > 2.0 or gained < 0.2)
