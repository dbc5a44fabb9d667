"""Further avalanches of a trial: the same path, sensors, population and hidden effects.

They come from a random stream of their own, so that a seed's campaign and truth stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skred.arrays import IntArray
from skred.campaign import Campaign
from skred.simulator.effects import Effect, hidden_of
from skred.simulator.fitting import predict
from skred.simulator.observe import observe
from skred.simulator.scene import (
    Scene,
    draw_recorded,
    draw_scores,
    noted_covariates,
    plausible_runs,
)
from skred.simulator.strength import Truth, plausible_readings

N_FRESH = 12
_STREAM = 20_912
_AT_ONCE, _MOST_DRAWS = 4, 50
"""Avalanches drawn for each that is wanted, and how often at most until enough of them are plausible."""


@dataclass(frozen=True, eq=False)
class Source:
    """What further avalanches of a trial come from; as secret as its truth.

    Attributes
    ----------
    seed : int
        Of the trial.
    truth : Truth
    nasty : str or None
        As in `skred.simulator.observe`.
    name : str
        Of the campaign.
    """

    seed: int
    truth: Truth
    nasty: str | None
    name: str


def draw_fresh(source: Source, n: int = N_FRESH) -> Campaign:
    """Record further avalanches of a trial.

    They are of the population that the trial's were drawn from, as plausible, with covariates and noted
    releases like theirs; each has what is hidden, and the readings are as nasty. Where an effect depends on
    the order of the avalanches, they come in between those of the trial.

    Parameters
    ----------
    source : Source
    n : int
        How many.

    Returns
    -------
    Campaign
        Of the same name, track and sensors; events are named ``f01``, ``f02``, ...
    """
    rng = np.random.default_rng([source.seed, _STREAM])
    truth = draw_further(rng, source.truth, n)
    campaign, _ = observe(rng, truth, source.nasty)
    events = tuple(replace(event, id=f"f{i + 1:02d}") for i, event in enumerate(campaign.events))
    return replace(campaign, name=source.name, events=events)


def draw_further(rng: np.random.Generator, truth: Truth, n: int) -> Truth:
    """The truth of further avalanches of a trial, each as plausible as those of the trial had to be.

    Parameters
    ----------
    rng : numpy.random.Generator
    truth : Truth
        Of the trial.
    n : int
        How many.
    """
    for _ in range(_MOST_DRAWS):
        scene, effects = _draw(rng, truth, _AT_ONCE * n)
        there = _with(truth, scene, effects)
        values, _ = predict(scene.setting, there.theta, there.hidden)
        good = plausible_runs(scene, scene.theta())[0] & plausible_readings(scene, values)
        if good.sum() >= n:
            chosen = np.flatnonzero(good)[:n]
            weighed = [replace(effect, weight=effect.weight[chosen]) for effect in effects]
            return _with(truth, _some(scene, chosen), weighed)
    raise RuntimeError(f"hardly any further avalanche of this trial is plausible: fewer than {n} at once")


def _draw(rng: np.random.Generator, truth: Truth, n: int) -> tuple[Scene, list[Effect]]:
    """Further avalanches of a scene, and the effects as they act on them."""
    scene, setting = truth.scene, truth.scene.setting
    first, last = float(setting.releases_m.min()), float(setting.releases_m.max())
    ground = setting.ground
    noted = ground.to_campaign(rng.uniform(first, last, n))
    releases = ground.from_campaign(np.round(noted)) if last > first else np.full(n, first)
    recorded = draw_recorded(rng, n, len(setting.sensors.s_from_m))
    scores = draw_scores(rng, n, len(scene.median), scene.correlation)
    release_scores = rng.standard_normal(n).clip(-2.5, 2.5)
    drawn = noted_covariates(rng, n)
    further = replace(
        scene,
        setting=replace(setting, releases_m=releases, recorded=recorded),
        scores=scores,
        release_scores=release_scores,
        covariates={name: drawn[name] for name in scene.covariates},
    )
    return further, [replace(e, weight=e.weigh(rng, further.covariates, n)) for e in truth.effects]


def _some(scene: Scene, chosen: IntArray) -> Scene:
    """Some avalanches of a scene."""
    setting = scene.setting
    return replace(
        scene,
        setting=replace(setting, releases_m=setting.releases_m[chosen], recorded=setting.recorded[chosen]),
        scores=scene.scores[chosen],
        release_scores=scene.release_scores[chosen],
        covariates={name: values[chosen] for name, values in scene.covariates.items()},
    )


def _with(truth: Truth, scene: Scene, effects: Sequence[Effect]) -> Truth:
    """The truth of other avalanches; how well it can be detected stays that of the trial's own."""
    n_sensors = len(scene.setting.sensors.s_from_m) + 1
    hidden = hidden_of(effects, truth.strengths, scene.n_events, n_sensors)
    return replace(truth, scene=scene, effects=tuple(effects), hidden=hidden)
