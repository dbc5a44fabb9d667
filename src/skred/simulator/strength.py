"""Choose how strong hidden effects are, so that they can be seen as well as asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.simulator.detectability import FINAL_NODES, NODES, Detectability, Fit, detectability, fit
from skred.simulator.effects import Effect, Hidden, hidden_of
from skred.simulator.fitting import predict, target_of
from skred.simulator.readings import Sensors, read
from skred.simulator.scene import TAIL_M, Scene

_NO_SENSORS = Sensors(np.zeros(0), np.zeros(0))
FACTORS = (0.25, 1.8)
"""How far the base friction may be chosen anew."""
CLOSE_ENOUGH = 0.07
"""Of the signal-to-noise asked for."""
MOST_TRIES = 6


@dataclass(frozen=True, eq=False)
class Truth:
    """A scene with effects of chosen strength.

    Attributes
    ----------
    scene : Scene
        Track, avalanches, sensors.
    effects : tuple of Effect
        What is hidden.
    strengths : tuple of float
        Magnitudes of their strengths.
    factor : float
        By which the median of the first base parameter was multiplied.
    hidden : Hidden
        What the effects add to each event.
    found : Detectability
        Signal-to-noise and the base model's fit.
    """

    scene: Scene
    effects: tuple[Effect, ...]
    strengths: tuple[float, ...]
    factor: float
    hidden: Hidden
    found: Detectability

    @property
    def theta(self) -> FloatArray:
        """The events' latent parameters."""
        return self.scene.theta(self.factor)


def retuned_factor(scene: Scene, effects: Sequence[Effect], strengths: Sequence[float]) -> float | None:
    """Factor of the base friction with which the typical front stops where it does without the effects."""
    pairs = [(e, x) for e, x in zip(effects, strengths, strict=True) if e.retuned]
    if not pairs:
        return 1.0
    mean_weight = [replace(e, weight=np.array([np.mean(e.weight)])) for e, _ in pairs]
    hidden = hidden_of(mean_weight, [x for _, x in pairs], 1, 1)
    low, high, n = FACTORS[0], FACTORS[1], 12
    for _ in range(4):
        factors = np.linspace(low, high, n)
        parameters = np.tile(scene.median, (n, 1))
        parameters[:, 0] *= factors
        terms, releases = np.tile(hidden.terms, (n, 1, 1)), np.full(n, scene.nominal_release_m)
        setting = scene.setting
        runout = read(setting.ground, setting.base, parameters, releases, _NO_SENSORS, terms).values[:, -1]
        short = runout < scene.runout_m
        if short[0] or not short.any():
            return None
        first = int(np.argmax(short))
        low, high = factors[first - 1], factors[first]
    return float(0.5 * (low + high))


def assemble(
    scene: Scene,
    effects: Sequence[Effect],
    strengths: Sequence[float],
    start: Fit | None = None,
    n_nodes: int = NODES,
) -> Truth | None:
    """Put effects of given strengths into a scene; None where its avalanches are no longer plausible."""
    factor = retuned_factor(scene, effects, strengths)
    if factor is None:
        return None
    n_sensors = len(scene.setting.sensors.s_from_m) + 1
    hidden = hidden_of(effects, strengths, scene.n_events, n_sensors)
    theta = scene.theta(factor)
    if not _is_plausible(scene, theta, hidden):
        return None
    guess = None if start is None else start.theta
    found = detectability(scene.setting, theta, hidden, guess, n_nodes)
    return Truth(scene, tuple(effects), tuple(strengths), factor, hidden, found)


def _is_plausible(scene: Scene, theta: FloatArray, hidden: Hidden) -> bool:
    """Whether fronts stay on the track, most are recorded, and none is far too fast."""
    values, reached = predict(scene.setting, theta, hidden)
    return bool(
        plausible_readings(scene, values).all()
        and np.median(values[:, -1]) > scene.place(0.7)
        and np.mean(reached[:, :-1]) > 0.5
    )


def plausible_readings(scene: Scene, values: FloatArray) -> BoolArray:
    """Which fronts stay on the track, start at all and are not far too fast, from their exact readings."""
    runout = values[:, -1]
    moves = (runout > scene.nominal_release_m + 30.0) & (values[:, :-1].max(axis=1) < 75.0)
    return np.asarray(moves & (runout < scene.setting.ground.length_m - TAIL_M))


def nothing(scene: Scene) -> Truth:
    """A scene in which nothing is hidden."""
    hidden = hidden_of((), (), scene.n_events, len(scene.setting.sensors.s_from_m) + 1)
    theta = scene.theta()
    base_fit = fit(scene.setting, target_of(scene.setting, theta, None), None, theta)
    return Truth(scene, (), (), 1.0, hidden, Detectability(0.0, base_fit))


def refined(truth: Truth) -> Truth:
    """The same truth with its signal-to-noise found more exactly."""
    if not truth.effects:
        return truth
    found = assemble(truth.scene, truth.effects, truth.strengths, truth.found.base_fit, FINAL_NODES)
    return truth if found is None else found


def reach_snr(make: Callable[[float, Fit | None], Truth | None], snr: float) -> Truth | None:
    """Find the scale between 0 and 1 at which a trial has the signal-to-noise asked for.

    Parameters
    ----------
    make : callable
        From a scale of the strength (its logarithm between those of the plausible bounds) and the last base
        fit to a trial, or None where the avalanches are not plausible: then the scale is too large.
    snr : float
        Asked for.

    Returns
    -------
    Truth or None
        The closest found; None if there was none at all.
    """
    low, high = 0.0, 1.0
    best: Truth | None = None
    scale = 0.5
    for _ in range(MOST_TRIES):
        truth = make(scale, None if best is None else best.found.base_fit)
        if truth is None:
            high, scale = scale, 0.5 * (low + scale)
            continue
        reached = truth.found.snr
        if best is None or abs(np.log((reached + 0.05) / snr)) < abs(np.log((best.found.snr + 0.05) / snr)):
            best = truth
        if abs(reached / snr - 1.0) < CLOSE_ENOUGH or (scale > 0.99 and reached < snr):
            break
        low, high = (scale, high) if reached < snr else (low, scale)
        # signal-to-noise is nearly in proportion to the strength: a step in logs, kept inside the bracket
        guess = scale + np.log(snr / max(reached, 0.05)) / make_range(truth.effects)
        margin = 0.1 * (high - low)
        scale = float(np.clip(guess, low + margin, high - margin)) if high < 1.0 or guess < 1.0 else 1.0
        if high - low < 1e-3:
            break
    return best


def make_range(effects: Sequence[Effect]) -> float:
    """Log of the ratio of the plausible bounds, averaged over effects."""
    return float(np.mean([np.log(effect.high / effect.low) for effect in effects]))


def scaled(effect: Effect, scale: float) -> float:
    """Strength at a scale between 0 (lowest plausible) and 1 (highest)."""
    return float(effect.low * (effect.high / effect.low) ** scale)


def with_strength(scene: Scene, effect: Effect, snr: float) -> Truth | None:
    """One effect with the strength at which it has the signal-to-noise asked for."""

    def make(scale: float, start: Fit | None) -> Truth | None:
        return assemble(scene, [effect], [scaled(effect, scale)], start)

    return reach_snr(make, snr)


def with_two(scene: Scene, effects: Sequence[Effect], snr: float) -> tuple[Truth | None, list[float]]:
    """Two effects of like weight; the second value is the signal-to-noise of each if it were alone."""
    alone = [with_strength(scene, effect, snr / np.sqrt(2.0)) for effect in effects]
    if any(truth is None for truth in alone):
        return None, []
    known = [truth for truth in alone if truth is not None]
    wanted = [truth.strengths[0] for truth in known]
    pairs = list(zip(effects, wanted, strict=True))

    def make(scale: float, start: Fit | None) -> Truth | None:
        factor = 3.0 ** (2.0 * scale - 1.0)
        strengths = [float(np.clip(x * factor, e.low, e.high)) for e, x in pairs]
        return assemble(scene, effects, strengths, start)

    return reach_snr(make, snr), [truth.found.snr for truth in known]
