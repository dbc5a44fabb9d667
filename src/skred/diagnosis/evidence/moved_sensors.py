"""Sensors that are not where they were noted: what fronts read there, and where they are seen to stop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.inference.error_model import FrontsSeen, fronts_seen
from skred.inference.hierarchical.problem import HierarchicalProblem

_FAR_M = 1e7
"""Where the place is that every front comes to, and none [m]: beyond all tracks."""
_LEAST_M = 1.0
"""Between two places at least [m]: a moved sensor may be above one that fronts stopped above."""


class StopBounds(NamedTuple):
    """By which sensors fronts are known to have come to a place, or not to.

    Attributes
    ----------
    fronts : FrontsSeen
        Of the sensors as noted; places of a runout are 0.
    length_m : float
        Of the track: no sensor is moved beyond its ends.
    """

    fronts: FrontsSeen
    length_m: float

    def between(self, events: IntArray, shifts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest place that a front came to and highest that it did not, (n,) each, of moved sensors.

        Parameters
        ----------
        events : (n,) integer array
        shifts : (n, n_sensors) array, m
            How much further down than noted each sensor stands.
        """
        noted = self.fronts.take(events)
        # A span is moved as a whole, as the kernel does.
        by = np.clip(shifts, -noted.begins, self.length_m - noted.ends)
        moved = noted._replace(begins=noted.begins + by, ends=noted.ends + by)
        lowest, highest = moved.between()
        lowest, highest = np.maximum(lowest, -_FAR_M), np.minimum(highest, _FAR_M)
        return lowest, np.maximum(highest, lowest + _LEAST_M)

    def as_noted(
        self, stops: FloatArray, events: IntArray, shifts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Stops [m] as they compare with noted places, and the change of that per metre of them, (n,) each.

        As far beyond a noted place as they are beyond the sensor itself; between two this changes evenly.
        """
        lowest, highest = self.between(events, shifts)
        noted_lowest, noted_highest = self.between(events, np.zeros((1, len(self.fronts.ends))))
        above, below = noted_lowest - lowest, noted_highest - highest
        share = np.clip((stops - lowest) / (highest - lowest), 0.0, 1.0)
        inside = (share > 0.0) & (share < 1.0)
        slope = 1.0 + np.where(inside, (below - above) / (highest - lowest), 0.0)
        return stops + above + share * (below - above), slope


def stop_bounds(problem: HierarchicalProblem) -> StopBounds:
    """Of the recordings of a campaign."""
    fronts = fronts_seen(problem.campaign)
    begins, ends = (np.nan_to_num(places, nan=0.0) for places in (fronts.begins, fronts.ends))
    return StopBounds(fronts._replace(begins=begins, ends=ends), problem.terrain.length_m)
