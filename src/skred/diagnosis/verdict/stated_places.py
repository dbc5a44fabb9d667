"""What stated errors of sensors' places may do to an answer beyond its odds, which allow for them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ndtri

from skred.diagnosis.evidence.prior_odds import NOTHING
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.words import percent, plus_minus
from skred.inference.influence_words import enumerated
from skred.inference.intervals import ENDS


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
        f"its calibration takes places of sensors as exact: {sensor.id}, whose place is known to"
        f" {sensor.place_sd_m:g} m (sd), would read {how} so far up or down"
    )


def moved_as_stated(found: Diagnosis) -> str:
    """Sensors that recordings have elsewhere, as their stated errors allow, where nothing is claimed.

    If stated errors explain something at all; those whose 90 % interval does not hold where they were noted.
    """
    places = places_document(found)
    if places is None or found.decision.verdict not in ("nothing_missing", "cannot_tell"):
        return ""
    least = -float(ndtri(ENDS[0]))
    elsewhere = [one for one in places["sensors"] if abs(one["mean"]) > least * one["sd"]]
    if places["log_bayes_factor"] <= COUNTS or not elsewhere:
        return ""
    stand = [
        f"{one['sensor']} probably stands {plus_minus(abs(one['mean']), one['sd'], one['unit'])} further"
        f" {'down' if one['mean'] > 0.0 else 'up'} than noted"
        for one in elsewhere
    ]
    return (
        f"Stated errors of sensors' places explain what would else be missing: {enumerated(stand)} (log Bayes"
        f" factor {places['log_bayes_factor']:.1f} nats)."
    )


def strength_with_places(found: Diagnosis) -> str:
    """How strong what is named is with shifts of sensors fitted as well, where places have stated errors."""
    candidate = found.steps[0].candidate
    strength, unit = candidate.strength_with_places, candidate.mechanism.strength.unit
    if strength is None:
        return ""
    size = plus_minus(*strength, unit)
    return f"Fitted together with where sensors stand, as their stated errors allow, it is {size}."


def places_document(found: Diagnosis) -> dict[str, Any] | None:
    """Where sensors stand whose places have stated errors, with nothing added; None where there are none."""
    shifts = found.comparison.leading(NOTHING).shifts
    if shifts is None or not shifts.places.errors:
        return None
    numbers = zip(shifts.places.errors, shifts.mean, shifts.sd, strict=True)
    return {
        "log_bayes_factor": shifts.log_factor,
        "sensors": [
            {"sensor": sensor, "mean": float(mean), "sd": float(sd), "unit": "m"}
            for (sensor, _), mean, sd in numbers
        ],
    }


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
