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


def realised_gain(document: Any, fresh: Campaign) -> dict[str, Any] | None:
    """What fresh avalanches say of the predictors of a diagnosis.

    Parameters
    ----------
    document : mapping
        As `skred.diagnosis.verdict.predictors.predictors` gives it.
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
    before, after = from_dict(document["before"]), document.get("after")
    if after is None:
        return None
    difference = log_scores(from_dict(after), fresh) - log_scores(before, fresh)
    n = len(difference)
    se = float(difference.std(ddof=1) / np.sqrt(n)) if n > 1 else None
    return {"realised": float(difference.mean()), "se": se, "n_fresh": n}
