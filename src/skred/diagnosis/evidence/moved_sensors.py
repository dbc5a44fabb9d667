"""Sensors that are not where they were noted: what fronts read there, and where they are seen to stop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.inference.error_model import fronts_seen
from skred.inference.hierarchical.problem import HierarchicalProblem

_FAR_M = 1e7
"""Where the place is that every front comes to, and none [m]: beyond all tracks."""
_LEAST_M = 1.0
"""Between two places at least [m]: a moved sensor may be above one that fronts stopped above."""


class StopBounds(NamedTuple):
    """By which sensors fronts are known to have come to a place, or not to.

    Attributes
    ----------
    ends : (n_sensors,) array, m
        Where the sensors end as noted; 0 for a runout.
    came, stayed : (n_events, n_sensors) boolean arrays
        Whether the front came by a sensor; whether it stopped above.
    length_m : float
        Of the track: no sensor is moved beyond its ends.
    """

    ends: FloatArray
    came: BoolArray
    stayed: BoolArray
    length_m: float

    def between(self, events: IntArray, shifts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest place that a front came to and highest that it did not, (n,) each, of moved sensors.

        Parameters
        ----------
        events : (n,) integer array
        shifts : (n, n_sensors) array, m
            How much further down than noted each sensor stands.
        """
        there = np.clip(self.ends + shifts, 0.0, self.length_m)
        lowest = np.where(self.came[events], there, -_FAR_M).max(axis=1, initial=-_FAR_M)
        highest = np.where(self.stayed[events], there, _FAR_M).min(axis=1, initial=_FAR_M)
        return lowest, np.maximum(highest, lowest + _LEAST_M)

    def as_noted(
        self, stops: FloatArray, events: IntArray, shifts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Stops [m] as they compare with noted places, and the change of that per metre of them, (n,) each.

        As far beyond a noted place as they are beyond the sensor itself; between two this changes evenly.
        """
        lowest, highest = self.between(events, shifts)
        noted_lowest, noted_highest = self.between(events, np.zeros((1, len(self.ends))))
        above, below = noted_lowest - lowest, noted_highest - highest
        share = np.clip((stops - lowest) / (highest - lowest), 0.0, 1.0)
        inside = (share > 0.0) & (share < 1.0)
        slope = 1.0 + np.where(inside, (below - above) / (highest - lowest), 0.0)
        return stops + above + share * (below - above), slope


def stop_bounds(problem: HierarchicalProblem) -> StopBounds:
    """Of the recordings of a campaign."""
    ends = [0.0 if place is None else place[1] for place in problem.sensor_places]
    return StopBounds(np.array(ends), *fronts_seen(problem.campaign), problem.terrain.length_m)
