"""Tables of events between strengths of a mechanism: around which populations they stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skred.diagnosis.compare.screening import curve
from skred.diagnosis.evidence.coefficient import curve_near
from skred.diagnosis.evidence.event_quadrature import SCREENING
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.tabulated.coefficient_grid import locate
from skred.diagnosis.tabulated.tables import build_tables
from skred.diagnosis.tabulated.tabulated_op import tabulated_log_densities
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape
from tests.diagnosis.diagnosis_cases import base_of, first_events, trial


def test_tables_go_as_far_as_the_posterior_does() -> None:
    """A sensor that reads twice as much: the logarithm of that is 4.6 scales of its prior."""
    campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, 10)
    values = campaign.values.copy()
    values[:, 10] *= 2.0
    base = base_of(replace(campaign, values=values), "constant")
    shape = Shape(sensor=campaign.sensors[10].id)
    near = curve(base, placed(mechanisms()["sensor_bias"], base.setting, shape))
    near = curve_near(base, near, shape)
    mean, sd = near.moments
    located = locate(base, extended(base.problem, base.law, (near.direction,)), [near])
    assert mean + 3.0 * sd > 4.5 * near.scale
    assert located.mean[0] == pytest.approx(mean, abs=0.3 * sd)
    assert located.grid.points.max() > mean + 3.0 * sd


def test_medians_that_are_hardly_known_leave_a_covariance() -> None:
    """Cut off element by element this one would be none: of two medians the second is hardly known."""
    base = base_of(first_events(trial(9303, "sparse", "viscous_drag", "constant", 10.0).campaign, 8), "pcm")
    near = curve(base, placed(mechanisms()["viscous_drag"], base.setting, Shape()))
    near = curve_near(base, near, near.shape)
    extension = extended(base.problem, base.law, (near.direction,))
    located = locate(base, extension, [near])
    fits = []
    for fit in located.fits:
        covariance = np.array(fit.found.covariance)
        covariance[:2, :2] = [[0.5, 1.2], [1.2, 5.0]]
        fits.append(fit._replace(found=fit.found._replace(covariance=covariance)))
    tables = build_tables(base, extension, located._replace(fits=fits), SCREENING)
    assert np.isfinite(tables.modes).all()


def between_tables(heights: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Log densities of one avalanche at places on tables of one node each, less what the population has."""
    axes, n = heights.ndim, len(places)
    found = tabulated_log_densities(
        np.zeros((n, 1)), np.ones((n, 1, 1)), places.reshape(n, 1, axes), 1, np.zeros(axes), np.eye(axes),
        np.zeros(axes), np.array(heights.shape), np.zeros((heights.size, 1)), np.arange(heights.size + 1),
        np.zeros((1, heights.size)), heights.ravel(), np.empty(0),
    )  # fmt: skip
    return found[:, 0, 0] + 0.5 * np.log(2.0 * np.pi)


def test_between_tables_that_fall_off_a_cliff_nothing_is_far_above_the_two_nearest() -> None:
    """As where a strength leaves nothing of the base's: polynomials of any bend were 39 nats above."""
    heights, places = np.array([-275.0, -274.6, -281.5, -622.0]), np.linspace(0.0, 3.0, 61)
    found, nearest = between_tables(heights, places[:, None]), np.minimum(places.astype(int), 2)
    high, low = (order(heights[nearest], heights[nearest + 1]) for order in (np.maximum, np.minimum))
    assert (found <= high + 0.125).all() and (found >= low - 0.125).all()
    assert found[::20] == pytest.approx(heights)


@pytest.mark.parametrize("sd", [1.0, 2.0])
@pytest.mark.parametrize("top", [3.0, 3.5, 5.2, 8.8])
def test_between_tables_a_maximum_is_as_high(top: float, sd: float) -> None:
    """Of an avalanche that knows its own strength to so many steps; monotone ones were 0.12 nats too low."""
    places = np.linspace(0.0, 9.0, 91)
    found = between_tables(-0.5 * ((np.arange(10) - top) / sd) ** 2, places[:, None])
    assert found == pytest.approx(-0.5 * ((places - top) / sd) ** 2, abs=1e-6)


def test_between_tables_of_two_strengths() -> None:
    """What is straight along both is so between; the first strength's tables are the farthest apart."""
    places = np.random.default_rng(2).uniform(0.0, [4.0, 5.0], (20, 2))
    x, y = np.mgrid[:5, :6]
    assert between_tables(2.0 * x - 0.7 * y, places) == pytest.approx(2.0 * places[:, 0] - 0.7 * places[:, 1])
