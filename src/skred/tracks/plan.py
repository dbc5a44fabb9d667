"""A line in plan view: its length, and places along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import FloatArray
from skred.errors import InputError

MOST_POINTS = 100_000


@dataclass(frozen=True, eq=False)
class Plan:
    """A line on the map.

    Attributes
    ----------
    x, y : (n,) array, m
        Easting and northing of its vertices; no two neighbours are the same.
    """

    x: FloatArray
    y: FloatArray

    @property
    def along(self) -> FloatArray:
        """Horizontal distance of each vertex from the first, along the line [m]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(self.x), np.diff(self.y)))])

    @property
    def length(self) -> float:
        """Horizontal length [m]."""
        return float(self.along[-1])

    def turned(self) -> Plan:
        """The same line the other way round."""
        return Plan(self.x[::-1].copy(), self.y[::-1].copy())

    def then(self, other: Plan) -> Plan:
        """Go on with another line that begins where this one ends."""
        return Plan(np.append(self.x, other.x[1:]), np.append(self.y, other.y[1:]))

    def up_to(self, length: float) -> Plan:
        """The upper part of the line, of a length [m]."""
        along = self.along
        kept = along < length
        end = min(length, self.length)
        x, y = (np.append(of[kept], np.interp(end, along, of)) for of in (self.x, self.y))
        return Plan(x, y)

    def resampled(self, step: float) -> tuple[FloatArray, Plan]:
        """Points at equal distances along the line.

        Parameters
        ----------
        step : float, m
            Largest distance; at least three points are made.

        Returns
        -------
        along : (n,) array, m
            Horizontal distance of each along the given line.
        Plan
            The points.

        Raises
        ------
        InputError
            If these are more than 100 000.
        """
        n = max(2, int(np.ceil(self.length / step - 1e-9)))
        if n >= MOST_POINTS:
            raise InputError(
                f"the line is {self.length:.0f} m long: {n + 1} points of {step:g} m, at most {MOST_POINTS} "
                "are made; choose a longer --step"
            )
        along = np.linspace(0.0, self.length, n + 1)
        return along, Plan(*(np.interp(along, self.along, of) for of in (self.x, self.y)))


def plan_of(x: FloatArray, y: FloatArray) -> Plan:
    """A line through points, of which neighbours that are the same are taken once."""
    kept = np.concatenate([[True], (np.diff(x) != 0) | (np.diff(y) != 0)])
    return Plan(np.asarray(x, float)[kept], np.asarray(y, float)[kept])
