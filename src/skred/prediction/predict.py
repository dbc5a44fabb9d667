"""Carry a calibrated population of avalanches to a track: how far, how fast, and how sure.

What is predicted is the next avalanche like those recorded. Three uncertainties stay apart: of the
population (how well the recordings determine it), from one avalanche to another, and of a reading.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from skred.inference.calibrate import calibrate
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY
from skred.inference.results import FORMAT, save
from skred.inference.sampling import SamplerSettings
from skred.physics.law import Law
from skred.prediction.document import named_places, prediction_document, recorded_runouts
from skred.prediction.files import write_prediction
from skred.prediction.fronts import new_fronts
from skred.prediction.probabilities import prediction_dataset, simulation_errors
from skred.prediction.reading_errors import reading_error
from skred.prediction.track import PredictionTrack, prediction_track

FloatArray = NDArray[np.float64]
Tell = Callable[[str], None]
_STEPS_M = (1.0, 2.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0, 200.0, 500.0)
_MOST_STEPS = 150


@dataclass(frozen=True)
class Simulation:
    """How much is simulated.

    Attributes
    ----------
    populations : int
        Draws of the posterior, evenly thinned.
    avalanches : int
        New avalanches of each, a power of 2.
    """

    populations: int = 400
    avalanches: int = 1024


def predict(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    folder: Path,
    track: PredictionTrack | None = None,
    tell: Tell = lambda line: None,
    *,
    simulation: Simulation | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Calibrate a law and predict with it.

    Parameters
    ----------
    problem : HierarchicalProblem
    law : Law
    settings : SamplerSettings
    folder : Path
        Gets ``posterior.nc`` and the files of `write_prediction`.
    track : PredictionTrack, optional
        By default the campaign's own, from its own releases.
    tell : callable
        Detectability one line for each stage.
    simulation : Simulation, optional
    progress : bool
        Whether the sampler shows its progress.

    Returns
    -------
    dict
        The content of ``prediction.json``.
    """
    started = time.monotonic()
    track = prediction_track(problem) if track is None else track
    tell(f"{law.id}: calibrating on {problem.campaign.name}")
    calibration = calibrate(problem, law, settings, progress=progress)
    save(calibration.tree, folder / "posterior.nc")
    data = None
    if calibration.gate.passed:
        tell(f"{law.id}: predicting on {track.name}")
        data = prediction_of(problem, law, calibration.tree, track, simulation or Simulation())
    else:
        tell(f"{law.id}: the gate failed: {'; '.join(calibration.gate.problems)}")
    document = prediction_document(calibration, track, data)
    document["seconds"] = time.monotonic() - started
    tell(f"writing {folder}")
    write_prediction(document, data, problem, folder)
    return document


def prediction_of(
    problem: HierarchicalProblem,
    law: Law,
    tree: xr.DataTree,
    track: PredictionTrack,
    simulation: Simulation,
) -> xr.Dataset:
    """What a calibration's populations do on a track.

    Parameters
    ----------
    problem : HierarchicalProblem
        For the errors of readings, and its sensors' places.
    law : Law
    tree : DataTree
        As `skred.inference.results.assemble` makes it: its posterior and attributes are read.
    track : PredictionTrack
    simulation : Simulation

    Returns
    -------
    Dataset
        See `skred.prediction.probabilities.prediction_dataset`; with elevation and distance, and attributes.
    """
    samples = _thinned(problem, law, tree, simulation.populations)
    populations = population_of(law, samples)
    places = _places(problem, track)
    seed = int(tree.attrs["seed"])
    fronts = new_fronts(law, populations, track.terrain, track.releases, places, simulation.avalanches, seed)
    velocity, runout = (reading_error(problem.campaign, runout=which) for which in (False, True))
    recorded = recorded_runouts(problem, track)
    shortest = recorded[0] if recorded else None
    data = prediction_dataset(fronts, velocity, runout, shortest)
    points = track.track
    for name, values, what in (("x", points.x_m, "horizontal distance"), ("z", points.z_m, "elevation")):
        at_places = np.interp(places, points.s_m, values)
        data = data.assign_coords({name: ("s", at_places, {"units": "m", "long_name": what})})
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
        **({} if shortest is None else {"shortest_recorded_runout_m": shortest}),
        "reading_error_velocity": json.dumps(_plain_error(velocity._asdict())),
        "reading_error_runout": json.dumps(_plain_error(runout._asdict())),
    }
    return data


def _plain_error(error: Mapping[str, Any]) -> dict[str, Any]:
    """Without NaN, which JSON does not know."""
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in error.items()}


def _thinned(problem: HierarchicalProblem, law: Law, tree: xr.DataTree, most: int) -> dict[str, FloatArray]:
    posterior = tree["posterior"].to_dataset()
    samples = {p.name: posterior[p.name].values.ravel() for p in problem.parameters(law)}
    size = len(next(iter(samples.values())))
    chosen = np.unique(np.linspace(0, size - 1, min(size, most)).astype(int))
    return {name: values[chosen] for name, values in samples.items()}


def _places(problem: HierarchicalProblem, track: PredictionTrack) -> FloatArray:
    """Where fronts are looked at: every so many metres, at the sensors and the reference, at the end."""
    length = track.length_m
    fitting = (step for step in _STEPS_M if length <= _MOST_STEPS * step)
    step = next(fitting, length / _MOST_STEPS)
    regular = np.arange(0.0, length, step)
    own = [place for _, place in named_places(problem, track)]
    within = [s for s in (*regular, *own, *recorded_runouts(problem, track)) if 0.0 <= s < length]
    return np.array([*sorted(set(within)), length])


def _attributes(
    problem: HierarchicalProblem, law: Law, tree: xr.DataTree, track: PredictionTrack
) -> dict[str, Any]:
    copied = (
        "law", "equation", "campaign", "campaign_fingerprint", "smoothing_m", "settings", "seed", "gate",
        "versions",
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
