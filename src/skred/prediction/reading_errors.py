"""The error of a reading at any place, from those that a campaign states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.campaign import Campaign, Status
from skred.inference.error_model import ErrorModel


class ReadingError(NamedTuple):
    """Stated standard deviation of a reading of x: sqrt((relative x)^2 + absolute^2).

    Attributes
    ----------
    relative, absolute : float
        NaN where the campaign has no such sensor.
    rule : str
        Where it comes from.
    inflation : float
        Variance of an error under the error model, in stated variances.
    """

    relative: float
    absolute: float
    rule: str
    inflation: float = 1.0

    def variance(self, mean_square: FloatArray | float) -> FloatArray:
        """Mean variance over readings whose mean square is given."""
        return self.inflation * np.asarray(self.relative**2 * np.asarray(mean_square) + self.absolute**2)


def reading_error(campaign: Campaign, error_model: ErrorModel, *, runout: bool) -> ReadingError:
    """The campaign's usual error of a front velocity or of a runout.

    Where most readings state their own, the median of those; else the medians over the sensors.
    """
    what = "runouts" if runout else "front velocities"
    columns = [k for k, sensor in enumerate(campaign.sensors) if sensor.is_runout == runout]
    if not columns:
        return ReadingError(np.nan, np.nan, f"the campaign has no sensor of {what}")
    observed = campaign.status[:, columns] == Status.OBSERVED
    stated = campaign.stated_sd[:, columns][observed]
    own = stated[np.isfinite(stated)]
    if 2 * len(own) > len(stated):
        relative, absolute, rule = 0.0, float(np.median(own)), f"median of what the recorded {what} state"
    else:
        sensors = [campaign.sensors[k] for k in columns]
        relative = float(np.median([sensor.relative_sd for sensor in sensors]))
        absolute = float(np.median([sensor.absolute_sd for sensor in sensors]))
        rule = f"medians over the campaign's sensors of {what}"
    return ReadingError(relative, absolute, rule, error_model.variance)
