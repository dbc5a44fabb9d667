"""The PyMC model of a law on a campaign: for samplers and tools of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from skred.api import arguments
from skred.api.problems import chosen_laws, problem_of
from skred.api.sampling import Likelihood

if TYPE_CHECKING:
    import pymc as pm

    from skred.campaign import Campaign
    from skred.physics.law import Law


@arguments.told_by_name
def model(
    law: str | Law,
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    likelihood: Likelihood = "pooled",
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
) -> pm.Model:
    """The PyMC model that `calibrate` samples. What is not listed here is as of `calibrate`.

    Parameters
    ----------
    law : str or Law
        Its id, or itself.
    campaign : str, Path or Campaign
        A folder, the name of an included campaign, or a campaign that was read.
    likelihood : {"pooled", "hierarchical"}
        One set of parameters for the path, or one for every avalanche.

    Returns
    -------
    pymc.Model
        Its free variables are the law's parameters, and with the hierarchical likelihood spreads and
        correlations; its observed variable is ``recordings``.

    Raises
    ------
    skred.InputError
        As of `calibrate`.
    """
    [chosen] = chosen_laws([law], priors)
    built: pm.Model = chosen.build(problem_of(campaign, likelihood, errors, smoothing_m))
    return built
