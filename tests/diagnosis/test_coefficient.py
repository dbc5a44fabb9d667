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


def closed_form(top: float, sd: float, scale: float, either_sign: bool) -> tuple[float, float, float]:
    """Log Bayes factor, posterior mean and standard deviation."""
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
    """The comparison's grid: strengths in scales of the prior."""
    scale = mechanisms()["segment_drag"].added.scale  # type: ignore[union-attr]
    grid = scale * np.array([0.0, 0.2, 0.6, 1.2, 2.2, 3.5])
    one = quadratic("segment_drag", grid, top * scale, sd * scale)
    factor, mean, width = closed_form(top, sd, 1.0, False)
    assert one.log_bayes_factor == pytest.approx(factor, abs=0.1, rel=0.015)
    found = one.moments
    assert found[0] / scale == pytest.approx(mean, abs=0.06) and found[1] / scale == pytest.approx(
        width, rel=0.15
    )


@pytest.mark.parametrize("top", [-1.4, 0.0, 0.7])
@pytest.mark.parametrize("sd", [0.3, 0.8])
def test_normal(top: float, sd: float) -> None:
    scale = mechanisms()["sensor_bias"].added.scale  # type: ignore[union-attr]
    grid = np.array([0.2, 0.6, 1.2, 2.2, 3.5])
    one = quadratic(
        "sensor_bias", scale * np.concatenate([-grid[::-1], [0.0], grid]), top * scale, sd * scale
    )
    factor, mean, width = closed_form(top, sd, 1.0, True)
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
    factor, mean, width = closed_form(top, sd, 1.0, either)
    assert one.log_bayes_factor == pytest.approx(factor, abs=0.05)
    found = one.moments
    assert found[0] / scale == pytest.approx(mean, abs=0.02) and found[1] / scale == pytest.approx(
        width, rel=0.1
    )


def test_nothing_to_see_is_nearly_even() -> None:
    """A flat curve says nothing: a Bayes factor of 1 but for the prior's tail beyond the grid."""
    grid = 0.15 * np.array([-3.5, -2.2, -1.2, -0.6, -0.2, 0.0, 0.2, 0.6, 1.2, 2.2, 3.5])
    one = quadratic("sensor_bias", grid, 0.0, 1e9)
    assert one.log_bayes_factor == pytest.approx(0.0, abs=2e-3)
    assert one.moments[0] == pytest.approx(0.0, abs=1e-6)
    assert one.moments[1] == pytest.approx(0.15, rel=0.02)


def test_other_scales_of_the_prior() -> None:
    grid = 0.15 * np.array([-3.5, -2.2, -1.2, -0.6, -0.2, 0.0, 0.2, 0.6, 1.2, 2.2, 3.5])
    one = quadratic("sensor_bias", grid, 0.06, 0.08)
    for scale in (0.05, 0.1, 0.15):
        expected = closed_form(0.06, 0.08, scale, True)[0]
        assert one.log_factor_of(scale=scale) == pytest.approx(expected, abs=0.1)
