"""What a diagnosis promises of avalanches to come, kept with its answer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.predictor_document import as_dict
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.predict.unseen import Predictor, ProfileTerm, predictor_of


def predictors_of(found: Outcome) -> tuple[Predictor, Predictor | None]:
    """What the base law says of avalanches to come, and what it says with what was added, if anything was.

    Raises
    ------
    ValueError
        If the diagnosis did not get as far as a calibration.
    """
    if isinstance(found, NotDiagnosed):
        if found.calibration is None:
            raise ValueError(f"nothing was calibrated: {found.reason}")
        return predictor_of(found.calibration), None
    if isinstance(found.finding, ProfileLaw):
        return _with_profile(found, found.finding)
    after = predictor_of(found.steps[-1].calibration) if found.steps else None
    return predictor_of(found.reference), after


def _with_profile(found: Diagnosis, law: ProfileLaw) -> tuple[Predictor, Predictor]:
    """Without the force profile that was added and with it, under one error model."""
    problem = found.problem
    term = ProfileTerm.of(law.profile, found.comparison.leading(UNLISTED).base.setting)
    common = found.law.id, law.error_model, problem.place_sd_m, problem.terrain.smoothing_m
    before, after = (
        Predictor(*common, means, factors, (), strengths)
        for means, factors, strengths in (law.draws_before, law.draws_after)
    )
    return before, replace(after, profile=term)


def predictors(found: Outcome) -> dict[str, Any] | None:
    """Predictors before and after as plain data; None where nothing was calibrated."""
    if isinstance(found, NotDiagnosed) and found.calibration is None:
        return None
    before, after = predictors_of(found)
    return {"before": as_dict(before), "after": None if after is None else as_dict(after)}


def promised_gain(found: Outcome) -> float | None:
    """Gain of the log score for each avalanche, by those left out; None if nothing was added."""
    if isinstance(found, NotDiagnosed) or found.after is None:
        return None
    return float(np.mean(found.after.pointwise - found.before.pointwise))
