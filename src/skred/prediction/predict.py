"""Predict avalanches on a track from a calibrated population: runout, speed and their uncertainty.

What is predicted is the next avalanche like those recorded. Three uncertainties are kept apart: that of the
population (how well the recordings determine it), the variability between avalanches, and the reading error.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray, IntArray
from skred.inference.added_terms import AddedTerm
from skred.inference.calibrate import Calibration
from skred.inference.hierarchical.population import POPULATION, population_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY
from skred.inference.results import FORMAT, draws_by_name, save
from skred.physics.law import Law
from skred.prediction.at_places import at_places, unrecorded
from skred.prediction.document import prediction_document, recorded_runouts
from skred.prediction.files import write_prediction
from skred.prediction.fronts import new_fronts
from skred.prediction.own_places import own_places, shown_places
from skred.prediction.probabilities import prediction_dataset, simulation_errors
from skred.prediction.reading_errors import reading_error
from skred.prediction.return_periods import runouts_once_in
from skred.prediction.source import Source
from skred.prediction.terms import moved
from skred.prediction.track import PredictionTrack, prediction_track
from skred.prediction.wanted import AVALANCHES, Wanted

Tell = Callable[[str], None]
_STEPS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 500.0)
_MOST_STEPS = 150


@dataclass(frozen=True)
class Simulation:
    """Size of the simulation.

    Attributes
    ----------
    populations : int
        Draws of the posterior, evenly thinned.
    avalanches : int
        New avalanches of each, a power of 2.
    """

    populations: int = 400
    avalanches: int = AVALANCHES


def predict(
    calibration: Calibration,
    folder: Path,
    track: PredictionTrack | None = None,
    tell: Tell = lambda line: None,
    *,
    simulation: Simulation | None = None,
    wanted: Wanted | None = None,
    source: Source | None = None,
    command: str | None = None,
) -> dict[str, Any]:
    """Predict with a calibrated law.

    Parameters
    ----------
    calibration : Calibration
        Hierarchical.
    folder : Path
        Gets ``posterior.nc`` and the files of `write_prediction`.
    track : PredictionTrack, optional
        By default the campaign's own, from its own releases.
    tell : callable
        Takes one line for each stage.
    simulation : Simulation, optional
    wanted : Wanted, optional
        Named places, thresholds and frequency.
    source : Source, optional
        Where the calibration was read from, with what was added to its law.
    command : str, optional
        What was typed.

    Returns
    -------
    dict
        The content of ``prediction.json``.
    """
    started = time.monotonic()
    problem, law = calibration.problem, calibration.law
    assert isinstance(problem, HierarchicalProblem)
    track = prediction_track(problem) if track is None else track
    wanted = wanted or Wanted()
    simulation = simulation or Simulation()
    wanted.check_on(track.length_m, simulation.avalanches, highest_release_m=track.highest_release_m)
    save(calibration.tree, folder / "posterior.nc")
    data, base, added = None, None, () if source is None else source.stored.added
    if calibration.gate.passed:
        tell(f"{law.id}: predicting on {track.name}")
        data = prediction_of(problem, law, calibration.tree, track, simulation, added=added, wanted=wanted)
        base = _without_added(source, track, simulation, wanted, tell)
    else:
        tell(f"{law.id}: the chains did not converge: {'; '.join(calibration.gate.problems)}")
    document = prediction_document(calibration, track, data, wanted, source, base, command)
    document["seconds"] = time.monotonic() - started
    tell("writing the results")
    write_prediction(document, data, problem, folder)
    return document


def _without_added(
    source: Source | None, track: PredictionTrack, simulation: Simulation, wanted: Wanted, tell: Tell
) -> xr.Dataset | None:
    """The same avalanches by the base law, where something was added to it and its chains converged."""
    base = None if source is None else source.without
    if source is None or base is None:
        return None
    law, seed = base.calibration.law, int(source.stored.calibration.tree.attrs["seed"])
    if not base.calibration.gate.passed:
        tell(f"{law.id} without what was added: its chains did not converge, so it is not compared")
        return None
    tell(f"{law.id}: predicting without what was added")
    return prediction_of(
        base.problem, law, base.calibration.tree, track, simulation, wanted=wanted, seed=seed
    )


def prediction_of(
    problem: HierarchicalProblem,
    law: Law,
    tree: xr.DataTree,
    track: PredictionTrack,
    simulation: Simulation,
    *,
    added: Sequence[AddedTerm] = (),
    wanted: Wanted | None = None,
    seed: int | None = None,
) -> xr.Dataset:
    """Avalanches of a calibration's populations on a track.

    Parameters
    ----------
    problem : HierarchicalProblem
        For the errors of readings, and its sensors' places.
    law : Law
    tree : DataTree
        As `skred.inference.results.assemble` makes it: its posterior and attributes are read.
    track : PredictionTrack
    simulation : Simulation
    added : sequence of AddedTerm
        What was added to the law; of it is used what acts on this track.
    wanted : Wanted, optional
    seed : int, optional
        Of the avalanches; by default that of the calibration.

    Returns
    -------
    Dataset
        See `skred.prediction.probabilities.prediction_dataset`; with elevation and distance, curves of
        `skred.prediction.at_places`, and attributes: ``at`` has the rows of the named places as JSON.
    """
    wanted = wanted or Wanted()
    populations, chosen = _populations(problem, law, tree, simulation.populations)
    named = shown_places(problem, track, wanted)
    places = _places(problem, track, named)
    seed = int(tree.attrs["seed"]) if seed is None else seed
    draws = tree[POPULATION if POPULATION in tree.children else "posterior"].to_dataset()
    law_here = moved(law, added, draws, track, chosen)
    fronts = new_fronts(
        law_here.motion,
        populations,
        track.terrain,
        law_here.releases,
        places,
        simulation.avalanches,
        seed,
        weights=law_here.weights,
        kept=[int(np.abs(places - s_m).argmin()) for _, s_m in named],
    )
    campaign, errors = problem.campaign, problem.error_model
    velocity, runout = (reading_error(campaign, errors, runout=which) for which in (False, True))
    recorded = recorded_runouts(problem, track)
    shortest = recorded[0] if recorded else None
    data = prediction_dataset(fronts, velocity, runout, shortest)
    draws_of_rest = unrecorded(fronts, wanted, seed)
    rows, curves = at_places(fronts, named, wanted, draws_of_rest)
    rare: list[dict[str, Any]] = []
    if draws_of_rest.rate is not None:
        end_m = float(places[-1])
        rare = runouts_once_in(wanted.return_periods_years, fronts.runout, draws_of_rest.rate, end_m)
    data = data if curves is None else data.merge(curves)
    points = track.track
    for name, values, what in (("x", points.x_m, "horizontal distance"), ("z", points.z_m, "elevation")):
        along = np.interp(places, points.s_m, values)
        data = data.assign_coords({name: ("s", along, {"units": "m", "long_name": what})})
    stays = float((fronts.runout <= fronts.release).mean())
    data.attrs = _attributes(problem, law, tree, track) | {
        "simulation": json.dumps(
            {
                "populations": len(populations[0]),
                "avalanches_of_each": simulation.avalanches,
                **simulation_errors(fronts),
            }
        ),
        "share_that_does_not_start": stays,
        "at": json.dumps(rows),
        "runout_once_in": json.dumps(rare),
        "added": json.dumps(law_here.added),
        **({} if shortest is None else {"shortest_recorded_runout_m": shortest}),
        "reading_error_velocity": json.dumps(_plain_error(velocity._asdict())),
        "reading_error_runout": json.dumps(_plain_error(runout._asdict())),
    }
    return data


def _plain_error(error: Mapping[str, Any]) -> dict[str, Any]:
    """Without NaN, which JSON does not know."""
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in error.items()}


def _populations(
    problem: HierarchicalProblem, law: Law, tree: xr.DataTree, most: int
) -> tuple[tuple[FloatArray, FloatArray], IntArray]:
    """Means and factors of evenly thinned draws, and their numbers, chain after chain."""
    if POPULATION in tree.children:
        group = tree[POPULATION].to_dataset()
        chosen = _evenly(group.sizes["draw"], most)
        return (group["mean"].values[chosen], group["factor"].values[chosen]), chosen
    samples = draws_by_name(problem, law, tree["posterior"].to_dataset())
    chosen = _evenly(len(next(iter(samples.values()))), most)
    return population_of(law, {name: values[chosen] for name, values in samples.items()}), chosen


def _evenly(size: int, most: int) -> IntArray:
    return np.unique(np.linspace(0, size - 1, min(size, most)).astype(np.int64))


def _places(
    problem: HierarchicalProblem, track: PredictionTrack, named: Sequence[tuple[str, float]]
) -> FloatArray:
    """Places of the predictions: at even steps, at sensors, reference and named ones, at the end."""
    length = track.length_m
    fitting = (step for step in _STEPS_M if length <= _MOST_STEPS * step)
    step = next(fitting, length / _MOST_STEPS)
    regular = np.arange(0.0, length, step)
    own = [place for _, place in (*own_places(problem, track).shown, *named)]
    within = [s for s in (*regular, *own, *recorded_runouts(problem, track)) if 0.0 <= s < length]
    return np.array([*sorted(set(within)), length])


def _attributes(
    problem: HierarchicalProblem, law: Law, tree: xr.DataTree, track: PredictionTrack
) -> dict[str, Any]:
    copied = (
        "law", "equation", "changed_priors", "campaign", "campaign_fingerprint", "smoothing_m", "settings",
        "seed", "gate", "versions",
    )  # fmt: skip
    attributes = {
        "format": FORMAT,
        "title": f"{law.title}: the next avalanche on {track.name}",
        "error_model": problem.error_model.id,
        "track": track.name,
        "track_fingerprint": track.fingerprint(),
        "track_is_own": int(track.is_own),
        "release": track.release_text,
        "release_short": track.release_text.split(", the first")[0],
        "interval": f"{INTERVAL_KIND}, {INTERVAL_PROBABILITY:g}, over populations",
        **{name: tree.attrs[name] for name in copied if name in tree.attrs},
    }
    if track.reference_s_m is not None:
        attributes["reference_s_m"] = track.reference_s_m
    return attributes
