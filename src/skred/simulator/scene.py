"""Draw what a trial starts from: a track, a base law that suits it, avalanches, sensors and their errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.simulator.fitting import Setting
from skred.simulator.readings import PARAMETERS, Sensors, read
from skred.simulator.terrain import Ground, draw_ground

TrialKind = Literal["sparse", "dense"]

RANGES: dict[str, tuple[tuple[float, float], ...]] = {
    "pcm": ((0.12, 0.40), (8e-4, 6e-3)),
    "coulomb": ((0.2, 0.65),),
    "constant": ((1.2, 5.5),),
    "voellmy": ((0.08, 0.38), (8e-4, 8e-3)),
}
"""Base parameters are drawn log-uniformly in these, and kept where the typical front is plausible."""
PEAK_M_S = (20.0, 60.0)
REACH = (0.5, 0.85)
"""Where the typical front stops, as shares of the track's length."""
TAIL_M = 60.0
"""No front comes closer to the track's end [m]."""
SPREAD_MEDIAN, SPREAD_LOG_SD = 0.13, 0.4
_NO_SENSORS = Sensors(np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Scene:
    """A path and its avalanches before anything is hidden.

    Attributes
    ----------
    setting : Setting
        Track, base law, sensors, errors, what is recorded.
    median, spread : (n_parameters,) array
        Of the base parameters across events: median, and standard deviation of the log.
    correlation : float
        Of the logs of the two base parameters.
    scores : (n_events, n_parameters) array
        The events' deviations from the median, in units of the spread.
    release_scores : (n_events,) array
        The true release points' deviations in units of their standard deviation.
    nominal_release_m, runout_m : float
        Release and runout of the typical front [m on the true track].
    covariates : dict of str to (n_events,) array
        Properties of the events.
    """

    setting: Setting
    median: FloatArray
    spread: FloatArray
    correlation: float
    scores: FloatArray
    release_scores: FloatArray
    nominal_release_m: float
    runout_m: float
    covariates: dict[str, FloatArray]

    @property
    def n_events(self) -> int:
        """Number of avalanches."""
        return len(self.scores)

    def theta(self, factor: float = 1.0) -> FloatArray:
        """The events' true latent parameters, the median of the first base parameter times a factor."""
        logs = np.log(self.median) + self.spread * self.scores
        logs[:, 0] += np.log(factor)
        if self.setting.release_sd_m > 0:
            logs = np.column_stack([logs, self.release_scores])
        return np.asarray(logs)

    def place(self, share: float) -> float:
        """Place [m on the true track] at a share of the typical front's way."""
        return self.nominal_release_m + share * (self.runout_m - self.nominal_release_m)


def _typical(
    rng: np.random.Generator, ground: Ground, base: str, release: float
) -> tuple[FloatArray, float] | None:
    """Base parameters with which a front runs plausibly, and its runout [m]."""
    low, high = np.log(np.array(RANGES[base])).T
    drawn = np.exp(rng.uniform(low, high, (64, len(low))))
    found = read(ground, base, drawn, np.full(64, release), _NO_SENSORS)
    reach = found.values[:, -1] / ground.length_m
    good = (found.peak_m_s > PEAK_M_S[0]) & (found.peak_m_s < PEAK_M_S[1])
    good &= (reach > REACH[0]) & (reach < REACH[1])
    if not good.any():
        return None
    first = int(np.argmax(good))
    return drawn[first], float(found.values[first, -1])


def draw_scores(rng: np.random.Generator, n: int, k: int, correlation: float) -> FloatArray:
    """Correlated standard normal deviations."""
    matrix = np.full((k, k), correlation)
    np.fill_diagonal(matrix, 1.0)
    return np.asarray(rng.standard_normal((n, k)) @ np.linalg.cholesky(matrix).T)


def noted_covariates(rng: np.random.Generator, n: int) -> dict[str, FloatArray]:
    """All properties that may be noted of events, at the resolution they would be noted with."""
    return {
        "snow_temperature_degC": np.round(-np.abs(rng.normal(6.0, 3.5, n)), 1),
        "release_volume_m3": np.round(np.exp(rng.normal(10.0, 0.8, n)), -2) + 100.0,
        "new_snow_depth_m": np.round(np.exp(rng.normal(-0.4, 0.4, n)), 2),
        "snow_density_kg_m3": np.round(rng.normal(180.0, 40.0, n).clip(60.0, 400.0)),
    }


def _covariates(rng: np.random.Generator, n: int) -> dict[str, FloatArray]:
    """One to three properties of the events."""
    drawn = noted_covariates(rng, n)
    names = rng.permutation(sorted(drawn))[: rng.integers(1, 4)]
    return {str(name): drawn[str(name)] for name in names}


def draw_sensors(
    rng: np.random.Generator, kind: TrialKind, release: float, runout: float, lowest: float
) -> Sensors:
    """Places of the speed sensors [m on the true track]: three in the lower third, or many gates.

    The typical front runs from `release` to `runout`; no front starts below `lowest`.
    """
    way = runout - release
    if kind == "dense":
        n = int(rng.integers(30, 46))
        places = np.linspace(lowest + rng.uniform(20.0, 90.0), release + rng.uniform(0.98, 1.08) * way, n)
        places += rng.uniform(-0.2, 0.2, n) * (places[1] - places[0])
        return Sensors(places, places)
    shares = np.sort(rng.uniform(0.67, 0.97, 3))
    while np.min(np.diff(shares)) < 0.06:
        shares = np.sort(rng.uniform(0.67, 0.97, 3))
    s_from = release + shares * way
    s_to = s_from.copy()
    if rng.random() < 0.5:
        # as at Ryggfonn: mean speeds from sensor to sensor, and a speed at the lowest
        s_to[:2] = s_from[1:] if rng.random() < 0.5 else s_from[:2] + rng.uniform(0.5, 0.9) * np.diff(s_from)
    return Sensors(s_from, s_to)


def _on_grid(ground: Ground, sensors: Sensors) -> Sensors:
    """Sensors at places that have one decimal in the campaign."""
    there = [np.round(ground.to_campaign(s), 1) for s in (sensors.s_from_m, sensors.s_to_m)]
    return Sensors(*(ground.from_campaign(s) for s in there))


def _errors(rng: np.random.Generator, kind: TrialKind, n_speeds: int) -> tuple[FloatArray, FloatArray]:
    """Relative and absolute standard deviations; the runout is last."""
    relative = round(rng.uniform(0.05, 0.12) if kind == "sparse" else rng.uniform(0.01, 0.05), 3)
    absolute = round(rng.uniform(0.3, 1.0), 2)
    runout = round(rng.uniform(5.0, 15.0), 1)
    return np.append(np.full(n_speeds, relative), 0.0), np.append(np.full(n_speeds, absolute), runout)


def draw_recorded(rng: np.random.Generator, n_events: int, n_speeds: int) -> BoolArray:
    """Which readings there are; every event has at least one speed and one more reading."""
    share = np.append(np.full(n_speeds, rng.uniform(0.02, 0.12)), rng.uniform(0.0, 0.08))
    recorded = rng.random((n_events, n_speeds + 1)) >= share
    few = recorded.sum(axis=1) < 2
    recorded[few] = True
    return recorded


def draw_scene(rng: np.random.Generator, kind: TrialKind, base: str, family: str | None = None) -> Scene:
    """Draw a scene whose avalanches all run plausibly under the base law alone.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where chance comes from.
    kind : {"sparse", "dense"}
        Few speeds of many events, or many of few.
    base : str
        Base law.
    family : str, optional
        Kind of track; drawn if not given.
    """
    for _ in range(400):
        ground, release = draw_ground(rng, family), float(rng.uniform(110.0, 200.0))
        typical = _typical(rng, ground, base, release)
        if typical is None:
            continue
        median, runout = typical
        n = int(rng.integers(18, 31) if kind == "sparse" else rng.integers(12, 21))
        k = len(PARAMETERS[base])
        spread = np.exp(rng.normal(np.log(SPREAD_MEDIAN), SPREAD_LOG_SD, k)).clip(0.04, 0.3)
        correlation = float(rng.uniform(-0.6, 0.6)) if k > 1 and rng.random() < 0.5 else 0.0
        release_sd = 20.0 if rng.random() < 0.4 else 0.0
        noted = release + (rng.uniform(-30.0, 30.0, n) if rng.random() < 0.4 else np.zeros(n))
        noted = ground.from_campaign(np.round(ground.to_campaign(noted)))
        lowest = float(noted.max()) + 2.5 * release_sd
        sensors = _on_grid(ground, draw_sensors(rng, kind, release, runout, lowest))
        n_speeds = len(sensors.s_from_m)
        relative, absolute = _errors(rng, kind, n_speeds)
        recorded = draw_recorded(rng, n, n_speeds)
        setting = Setting(ground, base, sensors, noted, release_sd, relative, absolute, recorded, median)
        scores, release_scores = draw_scores(rng, n, k, correlation), rng.standard_normal(n).clip(-2.5, 2.5)
        covariates = _covariates(rng, n)
        scene = Scene(
            setting, median, spread, correlation, scores, release_scores, release, runout, covariates
        )
        if runs_plausibly(scene, scene.theta()):
            return scene
    raise RuntimeError(f"no plausible scene for the base law {base} on tracks of the family {family}")


def runs_plausibly(scene: Scene, theta: FloatArray) -> bool:
    """Whether no front of the base law leaves the track, stops high up, or is far too fast."""
    each, runout = plausible_runs(scene, theta)
    return bool(each.all() and np.mean(runout > scene.place(0.75)) > 0.7)


def plausible_runs(scene: Scene, theta: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Which fronts of the base law stay on the track, stop not high up, and are not far too fast; runouts."""
    setting, k = scene.setting, len(scene.median)
    deviation = scene.release_scores * setting.release_sd_m
    found = read(
        setting.ground, setting.base, np.exp(theta[:, :k]), setting.releases_m + deviation, _NO_SENSORS
    )
    runout = found.values[:, -1]
    on_track = (runout < setting.ground.length_m - TAIL_M) & (runout > scene.place(0.3))
    return on_track & (found.peak_m_s < 70.0), runout


def with_reference_speed(scene: Scene, cubics: FloatArray) -> Scene:
    """The scene with another reference speed along its track."""
    table = scene.setting.ground.table.copy()
    table[:, 2] = cubics
    return replace(scene, setting=replace(scene.setting, ground=replace(scene.setting.ground, table=table)))
