"""Which sensors' places have stated errors: shifts with these as priors, nuisances of every model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skred.arrays import FloatArray
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.sensor_place import MECHANISM
from skred.physics.mechanisms.spec import Direction, Setting, Shape


@dataclass(frozen=True)
class StatedPlaces:
    """Sensors of front velocity whose places have stated errors: by `discrepancy.climb` values like any.

    Attributes
    ----------
    errors : tuple of (str, float)
        Sensors and the standard deviations of their places [m].
    """

    errors: tuple[tuple[str, float], ...]

    @cached_property
    def sd(self) -> FloatArray:
        """Of each shift [m], (n,)."""
        return np.array([sd for _, sd in self.errors])

    def each(self, setting: Setting) -> list[Direction]:
        """The shift of each sensor, a metre of it."""
        direction = added_of(MECHANISM).direction
        return [direction(setting, Shape(sensor=sensor)) for sensor, _ in self.errors]

    def together(self, setting: Setting, values: FloatArray) -> tuple[list[Direction], FloatArray]:
        """The same, with the shifts [m]."""
        return self.each(setting), values


EXACT = StatedPlaces(())
"""Where no place has a stated error."""


def stated_places(problem: HierarchicalProblem) -> StatedPlaces:
    """Those of a campaign, perhaps none."""
    read = (problem.observed | problem.readings.bounded).any(axis=0)
    sensors = [one for one, has in zip(problem.campaign.sensors, read, strict=True) if has]
    return StatedPlaces(
        tuple((one.id, one.place_sd_m) for one in sensors if one.place_sd_m and not one.is_runout)
    )
