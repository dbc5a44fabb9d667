"""What instruments would read of fronts: speed at a point, mean speed over a span, runout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.simulator.forces import TERM_WIDTH
from skred.simulator.march import fronts
from skred.simulator.terrain import GRID_M, Ground

TOLERANCE = 1e-6
"""Relative tolerance of a step."""

PARAMETERS: dict[str, tuple[str, ...]] = {
    "pcm": ("mu", "D"),
    "coulomb": ("mu",),
    "constant": ("b",),
    "voellmy": ("mu", "D"),
}
"""Parameters of the base laws: mu [1], D [1/m], b [m/s2]."""
_COLUMN = {"mu": 0, "D": 1, "b": 2}


@dataclass(frozen=True, eq=False)
class Sensors:
    """Where speeds are recorded; the runout is recorded as well, last.

    Attributes
    ----------
    s_from_m, s_to_m : (n_speeds,) array, m
        Places on the true track; equal for a point.
    """

    s_from_m: FloatArray
    s_to_m: FloatArray

    def moved(self, by_m: FloatArray) -> Sensors:
        """Each so many metres further down, (n_speeds,); spans as a whole."""
        return Sensors(self.s_from_m + by_m, self.s_to_m + by_m)


@dataclass(frozen=True, eq=False)
class Readings:
    """Exact readings of fronts.

    Attributes
    ----------
    values : (n_runs, n_speeds + 1) array
        Speeds [m/s] and runout [m along the true track]. A span in which the front stops: its mean speed up
        to there.
    reached : (n_runs, n_speeds + 1) bool array
        Whether the front came to the point, or to the span's end.
    peak_m_s : (n_runs,) array
        Highest speed.
    """

    values: FloatArray
    reached: BoolArray
    peak_m_s: FloatArray


def law_table(base: str, parameters: FloatArray) -> FloatArray:
    """Base law as `skred.simulator.forces.acceleration` reads it, from (n_runs, n_parameters) values."""
    table = np.zeros((len(parameters), 4))
    for k, name in enumerate(PARAMETERS[base]):
        table[:, _COLUMN[name]] = parameters[:, k]
    table[:, 3] = base in ("pcm", "coulomb")
    return table


def read(
    ground: Ground,
    base: str,
    parameters: FloatArray,
    releases_m: FloatArray,
    sensors: Sensors,
    terms: FloatArray | None = None,
) -> Readings:
    """Run fronts and read them.

    Parameters
    ----------
    ground : Ground
        The track.
    base : str
        One of `PARAMETERS`.
    parameters : (n_runs, n_parameters) array
        In the order of `PARAMETERS`.
    releases_m : (n_runs,) array, m
        Where the fronts start from rest.
    sensors : Sensors
        Where they are read.
    terms : (n_runs, n_terms, 12) array, optional
        Hidden forces.
    """
    if terms is None:
        terms = np.zeros((len(parameters), 0, TERM_WIDTH))
    places, index = np.unique(np.concatenate([sensors.s_from_m, sensors.s_to_m]), return_inverse=True)
    arrival, speed, ends = fronts(
        np.ascontiguousarray(releases_m, float),
        ground.table,
        GRID_M,
        law_table(base, parameters),
        np.ascontiguousarray(terms),
        places,
        TOLERANCE,
    )
    n = len(sensors.s_from_m)
    first, last = index[:n], index[n:]
    runout, duration = ends[:, :1], ends[:, 1:2]
    begun, reached = np.isfinite(arrival[:, first]), np.isfinite(arrival[:, last])
    until_s = np.where(reached, arrival[:, last], duration)
    until_m = np.where(reached, sensors.s_to_m, runout)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (until_m - sensors.s_from_m) / (until_s - arrival[:, first])
    mean = np.where(begun & np.isfinite(mean), mean, 0.0)
    speeds = np.where(first == last, speed[:, first], mean)
    values = np.concatenate([speeds, runout], axis=1)
    return Readings(values, np.concatenate([reached, runout > -np.inf], axis=1), ends[:, 2])
