"""Tables from no strength at all to far beyond what all avalanches could have in common.

Where avalanches differ in what is added, some have none of it and others several times as much. All tables
cover the same populations: that of the law with it, and the base's.
"""

from __future__ import annotations

import math

import numpy as np

from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import Budget
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.marginal import Evidence
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.tabulated.coefficient_grid import Grid, Located
from skred.diagnosis.tabulated.tables import Tables, build_tables

TABLES = 13
"""From nothing to the farthest strength: a step is less than what one avalanche tells of it."""
_FARTHEST, _FARTHEST_SD, _MOST_SCALES = 4.0, 6.0, 4.5
"""How far they reach: times the strength in common, its standard deviations beyond it, and scales of its
prior at most."""


def wide_tables(base: Base, curve: Curve, found: Evidence, budget: Budget, mean: float, sd: float) -> Tables:
    """Tables of one mechanism, evenly from no strength to far beyond that in common.

    Parameters
    ----------
    found : Evidence
        Populations that they cover.
    mean, sd : float
        Of the strength, as chains start around.
    """
    assert curve.mechanism.added is not None
    common, common_sd = curve.moments
    reach = max(_FARTHEST * abs(common), abs(common) + _FARTHEST_SD * common_sd)
    reach = min(reach, _MOST_SCALES * curve.mechanism.added.scale_of(curve.shape))
    farthest, size = math.copysign(reach, common), np.array([TABLES])
    grid = Grid(np.zeros(1), np.array([[farthest / (TABLES - 1)]]), size)
    fits = [Fit(found, curve.nearest(float(strength)).points) for strength in grid.points[:, 0]]
    located = Located(grid, fits, np.array([mean]), np.array([[sd]]), held=True)
    extension = extended(base.problem, base.law, (*base.directions, curve.direction))
    return build_tables(base, extension, located, budget)
