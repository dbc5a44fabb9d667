"""Identify what recordings can tell, and diagnose what a law leaves out.

Campaigns are a folder, the name of an included campaign, or a `Campaign`; laws an id or a `Law`. Times, seeds
and defaults are those of the commands of the same names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from skred.api import arguments
from skred.api.problems import campaign_of, chosen_laws, hierarchical_of
from skred.api.results import Result, fresh_folder
from skred.api.sampling import Tell, silent

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.physics.law import Law


@arguments.told_by_name
def identify(
    law: str | Law = "pcm",
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    tell: Tell = silent,
) -> Result:
    """Say what recordings can tell at all: from what strength on each mechanism would be seen.

    What is not listed here is as of `calibrate`. The likelihood is the hierarchical one.

    Parameters
    ----------
    tell : callable
        Called with one line as each stage begins.

    Returns
    -------
    Result
        Its document is ``identify.json``; nothing is sampled.

    Raises
    ------
    skred.InputError
        As of `calibrate`.
    """
    from skred.diagnosis.detect.run import identify_to

    [chosen] = chosen_laws([law], priors)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing_m)
    subject = f"{chosen.title}, on {problem.campaign.name}"
    with fresh_folder() as folder:
        document = identify_to(problem, chosen, folder, tell)
        return Result("identify", subject, document, None, folder)


@arguments.told_by_name
def diagnose(
    law: str | Law = "pcm",
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    quick: bool = False,
    exact_loo: bool = False,
    max_mechanisms: int | None = None,
    lock: int = 0,
    outer_folds: int = 0,
    seed: int = 0,
    tell: Tell = silent,
) -> Result:
    """Say what physics a law leaves out, where and how surely, model it, and show what that improves.

    What is not listed here is as of `calibrate`. The likelihood is the hierarchical one.

    Parameters
    ----------
    quick : bool
        One mechanism at most, and no second comparison for another.
    exact_loo : bool
        Refit without every avalanche, not only where importance sampling is unreliable.
    max_mechanisms : int, optional
        Mechanisms added at most, one after the other; by default 2, quick 1.
    lock : int
        Avalanches set aside by chance before anything is looked at, and opened once at the end.
    outer_folds : int
        Repeat the whole diagnosis so often, each time without some avalanches, to predict those.
    tell : callable
        Called with one line as each stage begins.

    Returns
    -------
    Result
        Its document is ``verdict.json``; ``tree("augmented.nc")`` has the draws of the law with what was
        added, where something was.

    Raises
    ------
    skred.InputError
        As of `calibrate`.
    """
    from skred.diagnosis.effort import SAMPLING, effort_of
    from skred.diagnosis.run import diagnose_to

    if max_mechanisms is not None:
        max_mechanisms = arguments.whole("max_mechanisms", max_mechanisms, 1, 2)
    lock = arguments.whole("lock", lock, 0, 10_000)
    outer_folds = arguments.whole("outer_folds", outer_folds, 0, 10_000)
    seed = arguments.whole("seed", seed, 0, arguments.SEEDS - 1)
    [chosen] = chosen_laws([law], priors)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing_m)
    effort = replace(effort_of(quick), exact_loo=exact_loo)
    if max_mechanisms is not None:
        effort = replace(effort, max_mechanisms=max_mechanisms)
    settings, subject = replace(SAMPLING, seed=seed), f"{chosen.title}, on {problem.campaign.name}"
    with fresh_folder() as folder:
        document = diagnose_to(problem, chosen, settings, effort, folder, tell, lock=lock, folds=outer_folds)
        result = Result("diagnose", subject, document, None, folder)
        base = result.tree("base.nc") if (folder / "base.nc").is_file() else None
        object.__setattr__(result, "posterior", base)  # before anyone has seen it
        return result
