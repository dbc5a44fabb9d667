"""Parts of the recordings: without some avalanches, or without some kinds of readings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skred.arrays import BoolArray
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.predict.conditional import sensor_ends


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the recordings.

    Attributes
    ----------
    kept : (n_events,) boolean array
        Avalanches that are kept.
    left_out : (n_events, n_sensors) boolean array, optional
        Readings that are not.
    """

    kept: BoolArray
    left_out: BoolArray | None = None

    @property
    def key(self) -> bytes:
        """What tells it from others of the same recordings."""
        left_out = b"" if self.left_out is None else self.left_out.tobytes()
        return self.kept.tobytes() + left_out

    def whole(self) -> Part:
        """All of the recordings."""
        return Part(np.ones_like(self.kept))

    def fit(self, fit: Fit) -> Fit:
        """Where to begin with the avalanches that are kept."""
        return fit._replace(points=fit.points[self.kept])

    def base(self, base: Base) -> Base:
        """The base law on what is kept."""
        rows, readings = base.rows, base.rows.readings
        if self.left_out is not None:
            left = readings._replace(
                observed=readings.observed & ~self.left_out,
                least=np.where(self.left_out, -np.inf, readings.least),
                most=np.where(self.left_out, np.inf, readings.most),
            )
            rows = rows._replace(readings=left)
        return replace(base, rows=rows.take(np.flatnonzero(self.kept)), fit=self.fit(base.fit))


def kinds_of(base: Base) -> list[tuple[str, str | None, BoolArray]]:
    """Readings that may mean something else than they say, and each sensor's, as (n_events, n_sensors)."""
    readings, campaign = base.rows.readings, base.problem.campaign
    observed = readings.observed
    speeds = observed & readings.is_velocity
    first, last = sensor_ends(base.problem)
    # Stops that are recorded, one column for each sensor of the runout, with their standard deviations.
    stops = np.where(observed & ~readings.is_velocity, readings.values, np.nan)
    off = np.abs(0.5 * (first + last)[:, None] - stops[:, None])
    near = speeds & (off <= readings.sd(np.arange(len(stops)), readings.values)[:, None]).any(axis=2)
    kinds: list[tuple[str, str | None, BoolArray]] = [
        ("zeros", None, speeds & (readings.values == 0.0)),
        ("near a stop", None, near),
    ]
    for j, sensor in enumerate(campaign.sensor_ids):
        own = np.zeros_like(observed)
        own[:, j] = observed[:, j] | readings.bounded[:, j]
        kinds.append(("sensor", sensor, own))
    return [one for one in kinds if one[2].any()]
