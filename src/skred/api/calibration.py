"""Calibrate one law, or compare several.

Campaigns are a folder, the name of an included campaign, or a `Campaign`; laws an id or a `Law`. Times, seeds
and defaults are those of the commands of the same names.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.api import arguments
from skred.api.problems import chosen_laws, pooled_or_reason, problem_of
from skred.api.results import Result, fresh_folder
from skred.api.sampling import Likelihood, Sampler, Tell, settings_of, silent
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.inference.calibrate import Calibration
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.inference.problem import Problem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.law import Law


@arguments.told_by_name
def calibrate(
    law: str | Law,
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    likelihood: Likelihood = "pooled",
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    sampler: Sampler = "metropolis",
    draws: int = 1000,
    tune: int | None = None,
    chains: int = 4,
    seed: int = 0,
) -> Result:
    """Calibrate one law: sample its posterior and check it.

    Parameters
    ----------
    law : str or Law
        Its id, or itself.
    campaign : str, Path or Campaign
        A folder, the name of an included campaign, or a campaign that was read.
    likelihood : {"pooled", "hierarchical"}
        One set of parameters for the path, or one for every avalanche.
    errors : str, optional
        Error model of the hierarchical likelihood: ``robust`` (default), ``normal``, ``student``,
        ``correlated`` or ``scaled``. The pooled one has none.
    smoothing_m : float, optional
        Smoothing length of the terrain [m]; by default 10, in proportion less on tracks below 600 m.
    priors : mapping of str to float, optional
        Scales of priors by name of parameter, each in its unit: of a half-normal prior its scale, of a
        log-normal one its median.
    sampler : {"metropolis", "nuts", "smc"}
        PyMC's. NUTS should not be trusted alone here, and says so.
    draws : int
        Kept in each chain.
    tune : int, optional
        Draws before them; by default 500, hierarchical 1000.
    chains : int
        Sampled one beside the other.
    seed : int
        Of all randomness.

    Returns
    -------
    Result
        Its document is ``summary.json``; whether the chains converged is in its key ``gate``.

    Raises
    ------
    skred.InputError
        If the campaign, the law, the priors or an option cannot be used.
    """
    from skred.inference.fit import calibration_statement
    from skred.inference.sampling import KINKED

    arguments.sampling(draws, tune, chains, seed, sampler)
    [chosen] = chosen_laws([law], priors)
    problem = problem_of(campaign, likelihood, errors, smoothing_m)
    if sampler == "nuts":
        warnings.warn(KINKED, UserWarning, stacklevel=3)
    settings = settings_of(likelihood, draws, tune, chains, seed, sampler)
    subject = f"{chosen.title}, {likelihood}, on {problem.campaign.name}"
    with fresh_folder() as folder:
        calibration = calibrate_to(problem, chosen, settings, folder)
        document = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        document["statement"] = calibration_statement(calibration.entry())
        return Result("calibrate", subject, document, calibration.whole_tree, folder)


def calibrate_to(
    problem: Problem, law: Law, settings: SamplerSettings, folder: Path, *, progress: bool = False
) -> Calibration:
    """Calibrate, and write the documents into a folder."""
    from skred.inference.calibrate import calibrate as sample
    from skred.inference.calibrate import write_calibration

    calibration = sample(problem, law, settings, progress=progress)
    write_calibration(calibration, folder)
    return calibration


@arguments.told_by_name
def compare(
    laws: Sequence[str | Law] = ("coulomb", "pcm", "constant", "voellmy"),
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    likelihood: Likelihood = "pooled",
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    exact_loo: bool = False,
    draws: int = 1000,
    tune: int | None = None,
    chains: int = 4,
    seed: int = 0,
    tell: Tell = silent,
) -> Result:
    """Calibrate several laws, and say which one the recordings prefer and by how much.

    What is not listed here is as of `calibrate`.

    Parameters
    ----------
    laws : sequence of str or Law
        Ids, or the laws themselves.
    exact_loo : bool
        Hierarchical: refit without every avalanche, also where importance sampling is reliable.
    tell : callable
        Called with one line as each stage begins, such as ``print``.

    Returns
    -------
    Result
        Its document is ``compare.json``; the posterior has one child for each law.

    Raises
    ------
    skred.InputError
        As of `calibrate`.
    """
    import xarray as xr

    arguments.sampling(draws, tune, chains, seed)
    if isinstance(laws, (str, bytes)) or not hasattr(laws, "__iter__"):
        raise InputError(f"laws: expected several, as ['pcm', 'coulomb'], found {laws!r:.60}")
    chosen = chosen_laws(list(laws), priors)
    problem = problem_of(campaign, likelihood, errors, smoothing_m)
    settings = settings_of(likelihood, draws, tune, chains, seed)
    subject = f"{', '.join(law.id for law in chosen)}, {likelihood}, on {problem.campaign.name}"
    with fresh_folder() as folder:
        document = compare_to(problem, chosen, settings, folder, tell, exact=exact_loo)
        result = Result("compare", subject, document, xr.DataTree(), folder)
        children = {law.id: result.tree(f"{law.id}/posterior.nc") for law in chosen}
        assert result.posterior is not None
        result.posterior.children = children
        return result


def compare_to(
    problem: PooledProblem | HierarchicalProblem,
    laws: Sequence[Law],
    settings: SamplerSettings,
    folder: Path,
    tell: Tell,
    *,
    exact: bool,
) -> dict[str, Any]:
    """Compare by the likelihood that the problem is for, and write the documents into a folder."""
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.model_selection.compare import compare as compare_pooled
    from skred.model_selection.compare_hierarchical import compare_hierarchical

    if isinstance(problem, HierarchicalProblem):
        pooled = pooled_or_reason(problem.campaign, problem.terrain.smoothing_m)
        return compare_hierarchical(problem, pooled, laws, settings, folder, tell, exact=exact)
    return compare_pooled(problem, laws, settings, folder, tell)
