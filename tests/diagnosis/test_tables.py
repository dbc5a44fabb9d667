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
