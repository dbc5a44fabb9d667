"""Predict the next avalanche.

Campaigns are a folder, the name of an included campaign, or a `Campaign`; laws an id or a `Law`. Times, seeds
and defaults are those of the command of the same name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

from skred.api import arguments
from skred.api.problems import campaign_of, chosen_laws, hierarchical_of
from skred.api.results import Result, fresh_folder
from skred.api.sampling import Tell, settings_of, silent
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import Campaign
    from skred.inference.calibrate import Calibration
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.law import Law
    from skred.prediction.source import Source
    from skred.prediction.track import PredictionTrack
    from skred.prediction.wanted import Wanted


@arguments.told_by_name
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
    draws: int | None = None,
    tune: int | None = None,
    chains: int | None = None,
    seed: int | None = None,
    tell: Tell = silent,
) -> Result:
    """Say how fast and how far the next avalanche goes along a track, and how sure that is.

    Parameters and errors as of `calibrate`; ``pcm`` on Ryggfonn unless others are given. The document is
    ``prediction.json``.

    Parameters
    ----------
    from_folder : str or Path, optional
        Folder of a calibration, a prediction or a diagnosis: nothing is sampled then, and nothing that a
        calibration is made from may be given: law, campaign, errors, smoothing_m, priors, draws, tune,
        chains or seed.
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
    draws, tune, chains, seed : int, optional
        By default 1000, 1000, 4 and 0.

    Returns
    -------
    Result
        Its document is ``prediction.json``.

    Raises
    ------
    skred.InputError
        As of `calibrate`, and if the track cannot be used.
    """
    from skred.prediction.source import source_of
    from skred.prediction.track import prediction_track

    settings = _settings(draws, tune, chains, seed)
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
        if path == "" or not isinstance(path, (str, Path, NoneType)):
            raise InputError(f"{name}: expected a path, found {path!r:.60}")
    if from_folder is None:
        source = None
        [chosen] = chosen_laws(["pcm" if law is None else law], priors)
        recorded = campaign_of("ryggfonn" if campaign is None else campaign)
        problem = hierarchical_of(recorded, errors, smoothing_m)
    else:
        _refuse_beside(
            from_folder,
            {"law": law, "campaign": campaign, "errors": errors, "smoothing_m": smoothing_m}
            | {"priors": priors, "draws": draws, "tune": tune, "chains": chains, "seed": seed},
        )
        source = source_of(Path(from_folder))
        chosen, problem = source.stored.calibration.law, source.stored.problem
    where = prediction_track(problem, None if track is None else Path(track), scenarios)
    wanted.check_on(where.length_m, highest_release_m=where.highest_release_m)
    with fresh_folder() as folder:
        document, calibration = predict_to(
            problem, chosen, settings, folder, tell, where=where, wanted=wanted, source=source
        )
        return Result("predict", f"{chosen.title}, on {where.name}", document, calibration.tree, folder)


def _settings(draws: Any, tune: Any, chains: Any, seed: Any) -> SamplerSettings:
    """Settings of the sampler, those of the command where none are given."""
    draws, chains, seed = (
        default if given is None else given for given, default in ((draws, 1000), (chains, 4), (seed, 0))
    )
    arguments.sampling(draws, tune, chains, seed)
    return settings_of("hierarchical", draws, tune, chains, seed)


def _refuse_beside(from_folder: str | Path, given: Mapping[str, Any]) -> None:
    """Refuse what would calibrate otherwise than the folder was, even where it says the same."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"predict: the calibration in {from_folder} is made already; leave out {name}")


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
        pair = per_year if arguments.is_several(per_year) else (per_year, 0.0)
        rate = Rate(*arguments.numbers("per_year", pair, 2))
    places = tuple((name, arguments.number(f"at[{name!r:.40}]", place)) for name, place in at.items())
    return Wanted(places, speeds, pressures, (density[0], density[1]), (drag[0], drag[1]), rate, years)


def _scenarios(release_s_m: Any) -> list[tuple[float, float]] | None:
    """Releases with their weights."""
    if release_s_m is None:
        return None
    if not arguments.is_several(release_s_m):
        return [(arguments.number("release_s_m", release_s_m), 1.0)]
    pairs = [] if isinstance(release_s_m, (str, bytes)) else list(release_s_m)
    if not pairs:
        raise InputError(
            f"release_s_m: expected a place, or pairs of place and weight, found {release_s_m!r:.60}"
        )
    pairs = [arguments.numbers("release_s_m", pair, 2) for pair in pairs]
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
    command: str | None = None,
) -> tuple[dict[str, Any], Calibration]:
    """Predict, after a calibration where none is given, and write the documents into a folder."""
    from skred.inference.calibrate import calibrate as sample
    from skred.prediction.predict import predict as predict_avalanches

    if source is None:
        tell(f"{law.id}: calibrating on {problem.campaign.name}")
        calibration = sample(problem, law, settings, progress=progress)
    else:
        calibration = source.stored.calibration
    document = predict_avalanches(
        calibration, folder, where, tell, wanted=wanted, source=source, command=command
    )
    return document, calibration
