"""The alpha-beta model beside a comparison of laws."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.inference.alpha_beta import ALPHA_SD_DEG, alpha_beta
from skred.inference.problem import Problem


def alpha_beta_entry(problem: Problem) -> dict[str, Any]:
    """The alpha-beta model's extreme runout beside the largest recorded one.

    It predicts the runout of the extreme avalanche of a path, not the distribution of runouts. It cannot be
    compared by leave-one-event-out.
    """
    campaign, terrain = problem.campaign, problem.terrain
    runouts = [j for j, sensor in enumerate(campaign.sensors) if sensor.is_runout]
    slope = np.interp(campaign.track.s_m, terrain.middle_s_m, terrain.slope_rad)
    try:
        model = alpha_beta(campaign.track.x_m, campaign.track.z_m, slope)
    except ValueError as error:
        return {"reason": str(error)}
    zero = campaign.reference_s_m or 0.0
    entry = {
        "beta_deg": model.beta_deg,
        "alpha_deg": model.alpha_deg,
        "runout_m": model.runout_s_m(reference_s_m=zero),
        "runout_minus_1sd_m": model.runout_s_m(model.alpha_deg - ALPHA_SD_DEG, reference_s_m=zero),
        "note": "runouts relative to the campaign's reference" if zero else "runouts as arc length",
    }
    if runouts and np.isfinite(problem.values[:, runouts]).any():
        values = problem.values[:, runouts].max(axis=1, initial=-np.inf, where=problem.observed[:, runouts])
        largest = int(values.argmax())
        entry |= {
            "recorded_max_m": float(values[largest]) - zero,
            "recorded_max_event": campaign.event_ids[largest],
            "exceedance_of_recorded_max": model.exceedance_probability(float(values[largest])),
        }
    return entry
