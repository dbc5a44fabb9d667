"""What a diagnosis promises of avalanches to come, kept with its answer, and what they made of it later.

The process that diagnoses must not see those avalanches: it leaves predictors, which are scored elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from skred.campaign import Campaign
from skred.diagnosis.diagnose import Diagnosis
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.predict.predictor_document import as_dict, from_dict
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.predict.unseen import Predictor, ProfileTerm, log_scores, predictor_of
from skred.errors import InputError
from skred.inference.calibrate import Calibration


def predictors_of(diagnosis: Diagnosis) -> tuple[Predictor, Predictor | None]:
    """What the base law says of avalanches to come, and what it says with what was let in, if anything was.

    Raises
    ------
    ValueError
        If the diagnosis did not get as far as a calibration.
    """
    if diagnosis.profile is not None:
        return _with_profile(diagnosis, diagnosis.profile)
    before = calibration_before(diagnosis)
    if before is None:
        raise ValueError(f"nothing was calibrated: {diagnosis.cannot}")
    after = predictor_of(diagnosis.steps[-1].calibration) if diagnosis.steps else None
    return predictor_of(before), after


def _with_profile(diagnosis: Diagnosis, law: ProfileLaw) -> tuple[Predictor, Predictor]:
    """Without the force profile that was let in and with it, under one error model."""
    problem = diagnosis.problem
    assert diagnosis.comparison is not None
    term = ProfileTerm.of(law.profile, diagnosis.comparison.leading(UNLISTED).base.setting)
    common = diagnosis.law.id, law.error_model, problem.place_sd_m, problem.terrain.smoothing_m
    before, after = law.draws_before, law.draws_after
    return (
        Predictor(*common, before.means, before.factors, (), before.strengths),
        Predictor(*common, after.means, after.factors, (), after.strengths, term),
    )


def calibration_before(diagnosis: Diagnosis) -> Calibration | None:
    """The base law's, under the error model of what was let in, if anything was."""
    return diagnosis.reference if diagnosis.reference is not None else diagnosis.calibration


def predictors(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """Predictors before and after as plain data; None where nothing was calibrated."""
    if calibration_before(diagnosis) is None:
        return None
    before, after = predictors_of(diagnosis)
    return {"before": as_dict(before), "after": None if after is None else as_dict(after)}


def promised_gain(diagnosis: Diagnosis) -> float | None:
    """Gain of the log score for each avalanche, by those left out; None if nothing was let in."""
    before, after = diagnosis.before, diagnosis.after
    if before is None or after is None:
        return None
    return float(np.mean(after.pointwise - before.pointwise))


def realised_gain(document: Any, campaign: Campaign, fresh: Campaign) -> dict[str, Any] | None:
    """What fresh avalanches say of the predictors of a diagnosis.

    Parameters
    ----------
    document : mapping
        As `predictors` gives it.
    campaign : Campaign
        That was diagnosed.
    fresh : Campaign
        Avalanches that the diagnosis has not seen, past the same sensors.

    Returns
    -------
    dict or None
        ``realised``: mean over fresh avalanches of the log score after less before; ``se`` of it;
        ``n_fresh``; None if nothing was let in.

    Raises
    ------
    InputError
        If the document cannot be used, or the fresh avalanches are of another path.
    """
    if document is None:
        return None
    if not isinstance(document, Mapping) or "before" not in document:
        raise InputError("predictors: expected an object with before and after")
    check_same_path(campaign, fresh)
    before, after = from_dict(document["before"]), document.get("after")
    if after is None:
        return None
    difference = log_scores(from_dict(after), fresh) - log_scores(before, fresh)
    n = len(difference)
    se = float(difference.std(ddof=1) / np.sqrt(n)) if n > 1 else None
    return {"realised": float(difference.mean()), "se": se, "n_fresh": n}


def gain(diagnosis: Diagnosis, fresh: Campaign) -> dict[str, Any] | None:
    """Promised and realised gain of a diagnosis at hand; None if nothing was let in."""
    promised = promised_gain(diagnosis)
    realised = realised_gain(predictors(diagnosis), diagnosis.problem.campaign, fresh)
    return None if promised is None or realised is None else {"promised": promised, **realised}


def check_same_path(campaign: Campaign, other: Campaign) -> None:
    """Whether two campaigns have one track and the same sensors.

    Raises
    ------
    InputError
        If not.
    """
    same_track = np.array_equal(campaign.track.x_m, other.track.x_m)
    if not same_track or not np.array_equal(campaign.track.z_m, other.track.z_m):
        raise InputError(f"{other.name}: its track is not that of {campaign.name}")
    if _sensors(campaign) != _sensors(other):
        raise InputError(f"{other.name}: its sensors are not those of {campaign.name}")


def _sensors(campaign: Campaign) -> list[tuple[object, ...]]:
    return [
        (one.id, one.quantity, *((None, None) if one.is_runout else (one.s_from_m, one.s_to_m)))
        for one in campaign.sensors
    ]
