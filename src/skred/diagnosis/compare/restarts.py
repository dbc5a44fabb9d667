"""Modes that quadrature points have found and climbs from elsewhere have not.

Where a gate stands just above the stops, a front that stops a little too early is at a mode of its own, and
no step away from it gains anything. Points that are spread over the whole population lie beyond.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, event_modes, log_joint
from skred.diagnosis.evidence.event_quadrature import FINE, event_nodes
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING

FloatArray = NDArray[np.float64]


def better_modes(likelihood: EventLikelihood, population: Population, points: FloatArray) -> FloatArray:
    """Each event's mode, or a higher one that a climb from the node with most of its integral leads to.

    Parameters
    ----------
    points : (n_rows, n_base + 1) array
        Where climbs ended.

    Returns
    -------
    (n_rows, n_base + 1) array
        The same points but for rows with a higher mode.
    """
    modes = event_modes(likelihood, points, population)
    spread = event_nodes(likelihood, population, modes, FINE)
    n_rows, _, n = spread.points.shape
    away = spread.points - np.append(population.mean[0], 0.0)
    precision = population.precision[0][: n - 1, : n - 1]
    log_prior = -0.5 * np.einsum("rki,ij,rkj->rk", away[:, :, :-1], precision, away[:, :, :-1])
    best = (spread.log_weights + log_prior).argmax(axis=1)
    start = spread.points[np.arange(n_rows), best]
    again = event_modes(likelihood, start, population).points
    heights = [log_joint(likelihood, one, population) for one in (points, again)]
    return np.where((heights[1] > heights[0] + DECIDES_NOTHING)[:, None], again, points)
