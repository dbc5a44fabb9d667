"""Masked effects: the calibrated base model is right on average at every sensor.

Either the effect sorts events by a covariate whose mean effect is nil, or it is opposed on the same stretch
by a relief that equals it at the events' typical speed, so that faster fronts are retarded and slower ones
are not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from skred.arrays import FloatArray
from skred.simulator.effects import Effect
from skred.simulator.listed import LISTED
from skred.simulator.readings import Sensors, read
from skred.simulator.scene import Scene, with_reference_speed
from skred.simulator.strength import Truth, assemble, with_strength
from skred.simulator.terrain import GRID_M, cubics_of

MASKED = ("segment_drag", "entrainment", "covariate_friction")
LARGEST_MEAN = 1.0
"""Mean residual of a sensor over its standard error that counts as none."""
_OPPOSITION = 7
"""Column of a force's row that holds its opposition."""


def reference_speed(scene: Scene) -> FloatArray:
    """Root mean square speed [m/s] of the base law's fronts at the grid of the track's tables."""
    setting = scene.setting
    places = GRID_M * np.arange(len(setting.ground.table) + 1, dtype=np.float64)
    theta = scene.theta()[:, : len(scene.median)]
    releases = setting.releases_m + scene.release_scores * setting.release_sd_m
    speeds = read(setting.ground, setting.base, np.exp(theta), releases, Sensors(places, places)).values[
        :, :-1
    ]
    moving = np.maximum(np.sum(speeds > 0, axis=0), 1)
    mean = np.sqrt(np.sum(speeds**2, axis=0) / moving)
    return np.asarray(gaussian_filter1d(mean, 2.0, mode="nearest"))


def largest_mean(truth: Truth) -> float:
    """Largest mean residual of the calibrated base model over its standard error, over the sensors."""
    return float(np.nanmax(np.abs(truth.found.mean_residuals())))


def _opposed(effect: Effect, amount: float) -> Effect:
    row = effect.row.copy()
    row[_OPPOSITION] = amount
    details = {
        **effect.details,
        "opposed_by": "relief equal to it at the typical speed",
        "opposition": amount,
    }
    return replace(effect, row=row, details=details)


def draw_masked(rng: np.random.Generator, scene: Scene, snr: float) -> Truth | None:
    """Draw a masked effect of the signal-to-noise asked for; None where it would show on average."""
    name = str(rng.choice(MASKED))
    effect = LISTED[name](rng, scene)
    if effect.target == "friction":
        truth = with_strength(scene, effect, snr)
        return truth if truth is not None and largest_mean(truth) < LARGEST_MEAN else None
    scene = with_reference_speed(scene, cubics_of(reference_speed(scene)))
    effect = replace(effect, high=4.0 * effect.high)
    truth = with_strength(scene, _opposed(effect, 1.0), snr)
    if truth is None:
        return None
    best = truth
    for amount in (0.94, 1.06, 0.88, 1.12):
        if largest_mean(best) < LARGEST_MEAN:
            break
        other = assemble(scene, [_opposed(effect, amount)], truth.strengths, best.found.base_fit)
        if other is not None and largest_mean(other) < largest_mean(best):
            best = other
    return best if largest_mean(best) < LARGEST_MEAN else None
