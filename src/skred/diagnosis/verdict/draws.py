"""Draws of an augmented law, with where what was added acts and how strong it is over all places."""

from __future__ import annotations

import numpy as np
import xarray as xr

from skred.diagnosis.augment.coefficient import augmented_of, strength_of
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.verdict.mechanisms import INTERVAL


def augmented_draws(found: Diagnosis) -> xr.DataTree:
    """The draws of the last calibration, and a group ``added`` with what the verdict says.

    The chains hold the place at the best one, so that their spread of a strength is too narrow; the group has
    its mean and standard deviation over all places, and quantiles of both ends of the place, (added,) and
    (added, quantile), NaN where it is not local.

    Raises
    ------
    ValueError
        If no mechanism was added.
    """
    if not found.steps:
        raise ValueError("no mechanism was added")
    calibration = found.steps[-1].calibration
    names = [one.name for one in augmented_of(calibration).added]
    units = [step.candidate.mechanism.strength.unit for step in found.steps]
    strengths = [strength_of(found.steps, number) for number in range(len(names))]
    quantiles = (INTERVAL[0], 0.5, INTERVAL[1])
    ends = np.array(
        [[step.candidate.ends(share) or (np.nan, np.nan) for share in quantiles] for step in found.steps]
    )
    about_ends = {"units": "m", "comment": "quantiles over the posterior of the place"}
    group = xr.Dataset(
        {
            "strength_mean": ("added", [one.mean for one in strengths]),
            "strength_sd": ("added", [one.sd for one in strengths]),
            "unit": ("added", units),
            "s_from": (("added", "quantile"), ends[:, :, 0], about_ends),
            "s_to": (("added", "quantile"), ends[:, :, 1], about_ends),
        },
        coords={"added": names, "quantile": list(quantiles)},
        attrs={"comment": "over all places, with the allowance for the form of the term; as in verdict.json"},
    )
    groups = {path: node.to_dataset() for path, node in calibration.tree.subtree_with_keys}
    return xr.DataTree.from_dict({**groups, "added": group})
