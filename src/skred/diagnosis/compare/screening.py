"""Linearised screening: the evidence at every place along tangents, and by fronts where tangents mislead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at
from skred.diagnosis.evidence.event_quadrature import FRONTS, ROUGH, Budget
from skred.diagnosis.evidence.extension import extended
from skred.physics.mechanisms.spec import Mechanism, Shape

_GRID = (0.2, 0.6, 1.2)
"""Strengths at first, in scales of the prior: 45 % of a half-normal prior is below the second."""
_STRONGER = (2.2, 3.5)
"""Strengths beyond, where one from the last of these on is not hopeless: five in ten thousand are larger."""
_HOPELESS = 12.0
"""Nats behind the best at which stronger is not tried: it would count for one in a hundred thousand."""
_OUTSIDE = 2.2
"""A strength beyond the one that the linear model finds, relative to it, where no other is."""
_PROMISED = 0.3
"""Nats that a rough curve must have for fronts to be asked at its maximum."""
_FAR_OFF = 4.0
"""Standard deviations beyond which a reading is far off: one in sixteen thousand is by chance."""
_FAR_SHARE = 0.02
"""Share of such readings that is many: that of the robust error model's larger outlier share."""


def screening_budget(base: Base) -> Budget:
    """Nodes for a look at every place: readings along tangents, unless many readings are far off.

    Robust errors take what is far from a front for outliers and see no direction to go; only fronts
    themselves tell then that a strong effect brings them back.
    """
    extension = extended(base.problem, base.law, base.directions)
    predictions = extension.predict(base.rows.event, base.fit.points, base.strengths)[:, :-1]
    readings = base.rows.readings
    stated = np.hypot(readings.relative_sd * predictions, readings.absolute_sd)
    sd = np.where(readings.stated_sd > 0.0, readings.stated_sd, stated)
    far = np.abs(readings.values - predictions) > _FAR_OFF * sd
    return FRONTS if far[readings.observed].mean() > _FAR_SHARE else ROUGH


def curve(
    base: Base, mechanism: Mechanism, shape: Shape, budget: Budget, linear: float | None = None
) -> Curve:
    """Evidence along the strength of a mechanism, on a grid over its prior.

    Many recordings tell strengths far below the prior's scale; the grid alone would then miss where the
    evidence is. With the budget ``ROUGH`` quick enough for every place, and wrong by nats where fronts stop
    near sensors.

    Parameters
    ----------
    linear : float, optional
        The most probable strength in the linear model around no such mechanism.
    """
    added = mechanism.added
    assert added is not None
    scale = added.scale_of(shape)
    signs = np.array([-1.0, 1.0] if added.either_sign else [1.0])
    strengths = np.multiply.outer(signs, scale * np.array(_GRID)).ravel()
    if linear is not None and (added.either_sign or linear > 0.0):
        more = [linear] if abs(linear) * _OUTSIDE > scale * _GRID[0] else [linear, _OUTSIDE * linear]
        strengths = np.append(strengths, more)
    found = curve_at(base, mechanism, shape, strengths, budget)
    signs = signs[[_may_be_stronger(found, sign, scale * _GRID[-1]) for sign in signs]]
    if len(signs):
        stronger = np.multiply.outer(signs, scale * np.array(_STRONGER)).ravel()
        found = found.joined(curve_at(base, mechanism, shape, stronger, budget))
    return _by_fronts(base, found) if found.rough else found


def _may_be_stronger(found: Curve, sign: float, least: float) -> bool:
    """Whether a strength of some size or more, of a sign, is not hopeless."""
    strong = sign * found.strengths > 0.999 * least
    return bool(found.log_evidence[strong].max() > found.log_evidence.max() - _HOPELESS)


def _by_fronts(base: Base, rough: Curve) -> Curve:
    """A rough curve whose evidence for anything is what fronts say at its top, in proportion elsewhere.

    Where fronts stop, tangents can promise ten nats that are not there, at more places than are looked at
    again.
    """
    top = int(np.argmax(rough.log_evidence))
    promised = float(rough.log_evidence[top])
    if promised < _PROMISED:
        return rough
    strengths = rough.strengths[[top]]
    near = curve_at(base, rough.mechanism, rough.shape, strengths, FRONTS, rough)
    there = max(float(near.log_evidence[near.strengths == strengths[0]][0]), 0.0)
    heights = np.where(rough.log_evidence > 0.0, rough.log_evidence * (there / promised), rough.log_evidence)
    return replace(rough, log_evidence=heights)
