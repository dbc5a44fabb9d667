"""What fresh avalanches make of a diagnosis' predictors.

The process that diagnoses must not see those avalanches: it leaves predictors, which are scored elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from skred.campaign import Campaign
from skred.diagnosis.predict.predictor_document import from_dict
from skred.diagnosis.predict.unseen import log_scores
from skred.errors import InputError


def realised_gain(document: Any, campaign: Campaign, fresh: Campaign) -> dict[str, Any] | None:
    """What fresh avalanches say of the predictors of a diagnosis.

    Parameters
    ----------
    document : mapping
        As `skred.diagnosis.verdict.predictors.predictors` gives it.
    campaign : Campaign
        That was diagnosed.
    fresh : Campaign
        Avalanches that the diagnosis has not seen, past the same sensors.

    Returns
    -------
    dict or None
        ``realised``: mean over fresh avalanches of the log score after less before; ``se`` of it;
        ``n_fresh``; None if nothing was added.

    Raises
    ------
    InputError
        If the document cannot be used, or the fresh avalanches are of another path.
    """
    if document is None:
        return None
    if not isinstance(document, Mapping) or "before" not in document:
        raise InputError("predictors: expected an object with before and after")
    _check_same_path(campaign, fresh)
    before, after = from_dict(document["before"]), document.get("after")
    if after is None:
        return None
    difference = log_scores(from_dict(after), fresh) - log_scores(before, fresh)
    n = len(difference)
    se = float(difference.std(ddof=1) / np.sqrt(n)) if n > 1 else None
    return {"realised": float(difference.mean()), "se": se, "n_fresh": n}


def _check_same_path(campaign: Campaign, other: Campaign) -> None:
    """Refuse a campaign of another track, or of other sensors."""
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
