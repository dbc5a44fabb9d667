"""Calibrate, compare, identify, diagnose, predict: the commands of the same names, as functions.

Campaigns are a folder, the name of an included campaign, or a `Campaign`; laws an id or a `Law`. Times, seeds
and defaults are those of the commands.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from skred.api.problems import campaign_of, chosen_laws, hierarchical_of, pooled_or_reason, problem_of
from skred.api.results import Result, fresh_folder

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.law import Law

Tell = Callable[[str], None]
Likelihood = Literal["pooled", "hierarchical"]
Sampler = Literal["metropolis", "nuts", "smc"]


def _silent(line: str) -> None:
    """Tell nobody."""


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
    skred.errors.InputError
        If the campaign, the law, the priors or an option cannot be used.
    """
    from skred.inference.calibrate import calibrate as sample
    from skred.inference.calibrate import write_calibration
    from skred.inference.fit import calibration_statement
    from skred.inference.sampling import KINKED

    [chosen] = chosen_laws([law], priors)
    problem = problem_of(campaign, likelihood, errors, smoothing_m)
    if sampler == "nuts":
        warnings.warn(KINKED, UserWarning, stacklevel=2)
    calibration = sample(problem, chosen, _settings(likelihood, draws, tune, chains, seed, sampler))
    folder = fresh_folder()
    write_calibration(calibration, folder)
    document = _read(folder / "summary.json")
    document["statement"] = calibration_statement(calibration.entry())
    subject = f"{chosen.title}, {likelihood}, on {problem.campaign.name}"
    return Result("calibrate", subject, document, calibration.tree, folder)


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
    tell: Tell = _silent,
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
    skred.errors.InputError
        As of `calibrate`.
    """
    import xarray as xr

    chosen = chosen_laws(list(laws), priors)
    problem = problem_of(campaign, likelihood, errors, smoothing_m)
    folder = fresh_folder()
    settings = _settings(likelihood, draws, tune, chains, seed)
    document = compare_to(problem, chosen, settings, folder, tell, exact=exact_loo)
    subject = f"{', '.join(law.id for law in chosen)}, {likelihood}, on {problem.campaign.name}"
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


def identify(
    law: str | Law = "pcm",
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    tell: Tell = _silent,
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
    skred.errors.InputError
        As of `calibrate`.
    """
    from skred.diagnosis.detect.run import identify_to

    [chosen] = chosen_laws([law], priors)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing_m)
    folder = fresh_folder()
    document = identify_to(problem, chosen, folder, tell)
    return Result("identify", f"{chosen.title}, on {problem.campaign.name}", document, None, folder)


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
    tell: Tell = _silent,
) -> Result:
    """Say what physics a law leaves out, where and how surely, model it, and show what that improves.

    What is not listed here is as of `calibrate`. The likelihood is the hierarchical one.

    Parameters
    ----------
    quick : bool
        Fewer simulated campaigns for the check, and one mechanism at most.
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
    skred.errors.InputError
        As of `calibrate`.
    """
    from skred.diagnosis.effort import SAMPLING, effort_of
    from skred.diagnosis.run import diagnose_to

    [chosen] = chosen_laws([law], priors)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing_m)
    effort = replace(effort_of(quick), exact_loo=exact_loo)
    if max_mechanisms is not None:
        effort = replace(effort, max_mechanisms=max_mechanisms)
    folder, settings = fresh_folder(), replace(SAMPLING, seed=seed)
    document = diagnose_to(problem, chosen, settings, effort, folder, tell, lock=lock, folds=outer_folds)
    result = Result("diagnose", f"{chosen.title}, on {problem.campaign.name}", document, None, folder)
    base = result.tree("base.nc") if (folder / "base.nc").is_file() else None
    object.__setattr__(result, "posterior", base)  # before anyone has seen it
    return result


def predict(
    law: str | Law = "pcm",
    campaign: str | Path | Campaign = "ryggfonn",
    *,
    track: str | Path | None = None,
    release_s_m: float | None = None,
    errors: str | None = None,
    smoothing_m: float | None = None,
    draws: int = 1000,
    tune: int | None = None,
    chains: int = 4,
    seed: int = 0,
    tell: Tell = _silent,
) -> Result:
    """Say how fast and how far the next avalanche goes along a track, and how sure that is.

    What is not listed here is as of `calibrate`. The likelihood is the hierarchical one.

    Parameters
    ----------
    track : str or Path, optional
        A table like a campaign's ``track.csv``; by default the campaign's track.
    release_s_m : float, optional
        Where fronts start [m]; by default as recorded, on another track at its first point.
    tell : callable
        Called with one line as each stage begins.

    Returns
    -------
    Result
        Its document is ``prediction.json``.

    Raises
    ------
    skred.errors.InputError
        As of `calibrate`, and if the track cannot be used.
    """
    from skred.inference.calibrate import calibrate as sample
    from skred.prediction.predict import predict as predict_avalanches
    from skred.prediction.track import prediction_track

    [chosen] = chosen_laws([law], None)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing_m)
    where = prediction_track(problem, None if track is None else Path(track), release_s_m)
    calibration = sample(problem, chosen, _settings("hierarchical", draws, tune, chains, seed))
    folder = fresh_folder()
    document = predict_avalanches(calibration, folder, where, tell)
    return Result("predict", f"{chosen.title}, on {where.name}", document, calibration.tree, folder)


def _settings(
    likelihood: str, draws: int, tune: int | None, chains: int, seed: int, sampler: Sampler = "metropolis"
) -> SamplerSettings:
    """As the sampler wants them."""
    from skred.inference.sampling import TUNE, SamplerSettings

    return SamplerSettings(sampler, draws, TUNE[likelihood] if tune is None else tune, chains, seed)


def _read(file: Path) -> dict[str, Any]:
    import json

    return dict(json.loads(file.read_text(encoding="utf-8")))
