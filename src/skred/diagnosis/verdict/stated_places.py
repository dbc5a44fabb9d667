"""What stated errors of sensors' places may do to an answer beyond its odds, which allow for them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from skred.diagnosis.evidence.prior_odds import NOTHING
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.words import percent, plus_minus


def place_as_stated(found: Diagnosis) -> str:
    """How differently a sensor would read as far off as its place is known, where something is claimed.

    Of the sensor whose mean reading that shifts most, in its standard errors, and only where it is more than
    one: less could not be taken for what is claimed. Begins with a small letter.
    """
    problem = found.problem
    known = [j for j, one in enumerate(problem.campaign.sensors) if one.place_sd_m and not one.is_runout]
    known = [j for j in known if problem.observed[:, j].any()]
    if not known or found.decision.verdict in ("nothing_missing", "cannot_tell"):
        return ""
    most = max(known, key=lambda j: _shift(found, j)[0])
    errors, share = _shift(found, most)
    if errors <= 1.0:
        return ""
    sensor = problem.campaign.sensors[most]
    how = f"{percent(share)} faster or slower" if share < 1.0 else "something else"
    return (
        f"only its odds allow for stated errors of sensors' places: {sensor.id}, whose place is known to"
        f" {sensor.place_sd_m:g} m (sd), would read {how} so far up or down"
    )


def moved_as_stated(found: Diagnosis) -> str:
    """Sensors that recordings have elsewhere, as their stated errors allow, where nothing is claimed."""
    if found.decision.verdict not in ("nothing_missing", "cannot_tell"):
        return ""
    elsewhere = [one for one in places_document(found) if one["log_bayes_factor"] > COUNTS]
    return " ".join(
        f"As its stated error allows, {one['sensor']} probably stands"
        f" {plus_minus(abs(one['mean']), one['sd'], 'm')} further {_way(one['mean'])} than noted (log Bayes"
        f" factor {one['log_bayes_factor']:.1f} nats)."
        for one in elsewhere
    )


def _way(shift: float) -> str:
    return "down" if shift > 0.0 else "up"


def places_document(found: Diagnosis) -> list[dict[str, Any]]:
    """The shift of each sensor whose place has a stated error, with nothing added, as plain data."""
    return [
        {
            "sensor": one.shape.sensor,
            **dict(zip(("mean", "sd"), one.moments, strict=True)),
            "unit": one.mechanism.strength.unit,
            "log_bayes_factor": one.log_bayes_factor,
        }
        for one in found.comparison.leading(NOTHING).places
    ]


def _shift(found: Diagnosis, j: int) -> tuple[float, float]:
    """Of a sensor's mean reading, in its standard errors, and as a share of the typical speed there."""
    problem, setting = found.problem, found.comparison.under_each[0].base.setting
    sensor, seen = problem.campaign.sensors[j], problem.observed[:, j]
    assert sensor.place_sd_m is not None
    at = 0.5 * (sensor.s_from_m + sensor.s_to_m) + np.array([-1.0, 0.0, 1.0]) * sensor.place_sd_m
    above, there, below = np.interp(at, setting.terrain.edge_s_m, setting.front_speed)
    sd = problem.readings.sd(np.arange(len(seen)), np.full(problem.values.shape, there))[seen, j]
    differs = 0.5 * abs(below - above)
    error = math.sqrt(float(np.sum(sd**2))) / int(seen.sum())
    return differs / max(error, 1e-9), differs / max(float(there), 1e-9)
