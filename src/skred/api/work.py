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

from skred.api import arguments
from skred.api.problems import campaign_of, chosen_laws, hierarchical_of, pooled_or_reason, problem_of
from skred.api.results import Result, fresh_folder
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.inference.calibrate import Calibration
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.pooled.problem import PooledProblem
    from skred.inference.problem import Problem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.law import Law
    from skred.prediction.source import Source
    from skred.prediction.track import PredictionTrack
    from skred.prediction.wanted import Wanted

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
    from skred.inference.fit import calibration_statement
    from skred.inference.sampling import KINKED

    arguments.sampling(draws, tune, chains, seed, sampler)
    [chosen] = chosen_laws([law], priors)
    problem = problem_of(campaign, likelihood, errors, smoothing_m)
    if sampler == "nuts":
        warnings.warn(KINKED, UserWarning, stacklevel=2)
    folder, settings = fresh_folder(), _settings(likelihood, draws, tune, chains, seed, sampler)
    calibration = calibrate_to(problem, chosen, settings, folder)
    document = _read(folder / "summary.json")
    document["statement"] = calibration_statement(calibration.entry())
    subject = f"{chosen.title}, {likelihood}, on {problem.campaign.name}"
    return Result("calibrate", subject, document, calibration.tree, folder)


def calibrate_to(
    problem: Problem, law: Law, settings: SamplerSettings, folder: Path, *, progress: bool = False
) -> Calibration:
    """Calibrate, and write the documents into a folder."""
    from skred.inference.calibrate import calibrate as sample
    from skred.inference.calibrate import write_calibration

    calibration = sample(problem, law, settings, progress=progress)
    write_calibration(calibration, folder)
    return calibration


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

    arguments.sampling(draws, tune, chains, seed)
    if isinstance(laws, (str, bytes)) or not hasattr(laws, "__iter__"):
        raise InputError(f"laws: expected several, as ['pcm', 'coulomb'], found {laws!r:.60}")
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

    if max_mechanisms is not None:
        arguments.whole("max_mechanisms", max_mechanisms, 1, 2)
    arguments.whole("lock", lock, 0, 10_000)
    arguments.whole("outer_folds", outer_folds, 0, 10_000)
    arguments.whole("seed", seed, 0, arguments.SEEDS - 1)
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
    law: str | Law | None = None,
    campaign: str | Path | Campaign | None = None,
    *,
    from_folder: str | Path | None = None,
    track: str | Path | None = None,
    release_s_m: float | Sequence[tuple[float, float]] | None = None,
    at: Mapping[str, float] | None = None,
    speeds_m_s: Sequence[float] = (10.0, 20.0, 30.0),
    pressures_kpa: Sequence[float] = (),
    density_kg_m3: tuple[float, float] = (100.0, 300.0),
    drag_coefficient: tuple[float, float] = (1.0, 2.0),
    per_year: float | tuple[float, float] | None = None,
    return_periods_years: Sequence[float] = (),
    errors: str | None = None,
    smoothing_m: float | None = None,
    priors: Mapping[str, float] | None = None,
    draws: int = 1000,
    tune: int | None = None,
    chains: int = 4,
    seed: int = 0,
    tell: Tell = _silent,
) -> Result:
    """Say how fast and how far the next avalanche goes along a track, and how sure that is.

    Parameters and errors as of `calibrate`; ``pcm`` on Ryggfonn unless others are given. The document is
    ``prediction.json``.

    Parameters
    ----------
    from_folder : str or Path, optional
        Folder of a calibration, a prediction or a diagnosis: nothing is sampled then, and neither law,
        campaign, errors, smoothing nor priors may be given.
    track : str or Path, optional
        A table like a campaign's ``track.csv``, by default that of the campaign.
    release_s_m : float or sequence of (float, float), m, optional
        Where fronts start: one place, or several with their weights.
    at : mapping of str to float, m, optional
        Places by name; by default the campaign's sensors of speed and its reference.
    speeds_m_s, pressures_kpa : sequence of float
        Thresholds.
    density_kg_m3, drag_coefficient : (float, float)
        Lowest and highest, for impact pressures.
    per_year : float or (float, float), 1/year, optional
        How often avalanches like those recorded start, and the standard deviation of that.
    return_periods_years : sequence of float
        Of the runouts that are passed once in that time; they need `per_year`.

    Returns
    -------
    Result
        Its document is ``prediction.json``.

    Raises
    ------
    skred.errors.InputError
        As of `calibrate`, and if the track cannot be used.
    """
    from skred.prediction.source import source_of
    from skred.prediction.track import prediction_track

    arguments.sampling(draws, tune, chains, seed)
    wanted = _wanted(
        arguments.mapping("at", at, "names to places"),
        arguments.numbers("speeds_m_s", speeds_m_s),
        arguments.numbers("pressures_kpa", pressures_kpa),
        arguments.numbers("density_kg_m3", density_kg_m3, 2),
        arguments.numbers("drag_coefficient", drag_coefficient, 2),
        per_year,
        arguments.numbers("return_periods_years", return_periods_years),
    )
    scenarios = _scenarios(release_s_m)
    for name, path in (("from_folder", from_folder), ("track", track)):
        if path is not None and not isinstance(path, (str, Path)):
            raise InputError(f"{name}: expected a path, found {path!r:.60}")
    if from_folder is None:
        source = None
        [chosen] = chosen_laws([law or "pcm"], priors)
        problem = hierarchical_of(campaign_of(campaign or "ryggfonn"), errors, smoothing_m)
    else:
        given = {
            "law": law,
            "campaign": campaign,
            "errors": errors,
            "smoothing_m": smoothing_m,
            "priors": priors,
        }
        for name, value in given.items():
            if value is not None:
                raise InputError(
                    f"predict: the calibration in {from_folder} is made already; leave out {name}"
                )
        source = source_of(Path(from_folder))
        chosen, problem = source.stored.calibration.law, source.stored.problem
    where = prediction_track(problem, None if track is None else Path(track), scenarios)
    wanted.check_on(where.length_m)
    folder = fresh_folder()
    settings = _settings("hierarchical", draws, tune, chains, seed)
    document, calibration = predict_to(
        problem, chosen, settings, folder, tell, where=where, wanted=wanted, source=source
    )
    return Result("predict", f"{chosen.title}, on {where.name}", document, calibration.tree, folder)


def _wanted(
    at: Mapping[str, float],
    speeds: tuple[float, ...],
    pressures: tuple[float, ...],
    density: tuple[float, ...],
    drag: tuple[float, ...],
    per_year: Any,
    years: tuple[float, ...],
) -> Wanted:
    """What is asked of a prediction."""
    from skred.prediction.wanted import Rate, Wanted

    rate = None
    if per_year is not None:
        pair = per_year if hasattr(per_year, "__iter__") else (per_year, 0.0)
        rate = Rate(*arguments.numbers("per_year", pair, 2))
    places = tuple((name, arguments.number(f"at[{name!r:.40}]", place)) for name, place in at.items())
    return Wanted(places, speeds, pressures, (density[0], density[1]), (drag[0], drag[1]), rate, years)


def _scenarios(release_s_m: Any) -> list[tuple[float, float]] | None:
    """Releases with their weights."""
    if release_s_m is None:
        return None
    if not hasattr(release_s_m, "__iter__"):
        return [(arguments.number("release_s_m", release_s_m), 1.0)]
    if isinstance(release_s_m, (str, bytes)):
        raise InputError(
            f"release_s_m: expected a place, or pairs of place and weight, found {release_s_m!r:.60}"
        )
    pairs = [arguments.numbers("release_s_m", pair, 2) for pair in release_s_m]
    return [(place, weight) for place, weight in pairs]


def predict_to(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    folder: Path,
    tell: Tell,
    *,
    where: PredictionTrack,
    wanted: Wanted,
    source: Source | None = None,
    progress: bool = False,
) -> tuple[dict[str, Any], Calibration]:
    """Predict, after a calibration where none is given, and write the documents into a folder."""
    from skred.inference.calibrate import calibrate as sample
    from skred.prediction.predict import predict as predict_avalanches

    if source is None:
        tell(f"{law.id}: calibrating on {problem.campaign.name}")
        calibration = sample(problem, law, settings, progress=progress)
    else:
        calibration = source.stored.calibration
    return predict_avalanches(calibration, folder, where, tell, wanted=wanted, source=source), calibration


def _settings(
    likelihood: str, draws: int, tune: int | None, chains: int, seed: int, sampler: Sampler = "metropolis"
) -> SamplerSettings:
    """As the sampler wants them."""
    from skred.inference.sampling import TUNE, SamplerSettings

    return SamplerSettings(sampler, draws, TUNE[likelihood] if tune is None else tune, chains, seed)


def _read(file: Path) -> dict[str, Any]:
    import json

    return dict(json.loads(file.read_text(encoding="utf-8")))
