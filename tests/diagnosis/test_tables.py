"""Tables of events between strengths of a mechanism: around which populations they stand."""

from __future__ import annotations

import numpy as np

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
