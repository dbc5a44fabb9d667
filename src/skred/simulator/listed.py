"""Hidden effects that the campaign format lists: one function each, from a scene to an effect.

Their shapes differ from the templates of the models under test: soft edges, limited supply, saturation,
exponents that are not whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from skred.arrays import FloatArray
from skred.simulator.effects import Effect, force_row
from skred.simulator.forces import Kind
from skred.simulator.scene import Scene

Draw = Callable[[np.random.Generator, Scene], Effect]


def even(scene: Scene) -> FloatArray:
    """The same strength for every event."""
    return np.ones(scene.n_events)


def draw_stretch(
    rng: np.random.Generator, scene: Scene, shortest: float = 80.0, longest: float = 300.0
) -> tuple[float, float]:
    """A stretch of the recorded part of the track [m on the true track]."""
    dense = len(scene.setting.sensors.s_from_m) > 10
    longest = min(longest, 0.35 * (scene.runout_m - scene.nominal_release_m))
    length = rng.uniform(min(shortest, 0.8 * longest), longest)
    first, last = scene.place(0.12 if dense else 0.5), scene.place(0.97) - 0.6 * length
    start = rng.uniform(min(first, last - 1.0), last)
    return float(start), float(start + length)


def _coulomb_friction(rng: np.random.Generator, scene: Scene) -> Effect:
    row = force_row(Kind.DRY)
    return Effect("coulomb_friction", "mu", "1", 0.01, 0.35, even(scene), row=row, retuned=True)


def _centrifugal(rng: np.random.Generator, scene: Scene) -> Effect:
    row = force_row(Kind.CURVATURE)
    return Effect("centrifugal", "mu", "1", 0.02, 0.6, even(scene), row=row, retuned=True)


def _turbulent_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    exponent = float(rng.uniform(1.8, 2.2))
    row, details = force_row(Kind.POWER, 2.0, exponent), {"exponent": exponent}
    return Effect(
        "turbulent_drag", "D", "m-1", 3e-5, 6e-3, even(scene), row=row, retuned=True, details=details
    )


def _viscous_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    exponent = float(rng.uniform(0.85, 1.15))
    row, details = force_row(Kind.POWER, 1.0, exponent), {"exponent": exponent}
    return Effect("viscous_drag", "c", "s-1", 2e-3, 0.2, even(scene), row=row, retuned=True, details=details)


def _constant_retardation(rng: np.random.Generator, scene: Scene) -> Effect:
    row = force_row(Kind.CONSTANT, float(rng.uniform(400, 1200)), float(rng.uniform(0, 6)))
    return Effect("constant_retardation", "b", "m s-2", 0.05, 2.5, even(scene), row=row, retuned=True)


def _velocity_weakening(rng: np.random.Generator, scene: Scene) -> Effect:
    speed, exponent = float(rng.uniform(5.0, 12.0)), float(rng.uniform(1.0, 1.6))
    row, details = force_row(Kind.WEAKENING, speed, exponent), {"speed_m_s": speed, "exponent": exponent}
    return Effect(
        "velocity_weakening", "mu_s", "1", 0.01, 0.35, even(scene), row=row, retuned=True, details=details
    )


def _obstacle(rng: np.random.Generator, scene: Scene) -> Effect:
    dense = len(scene.setting.sensors.s_from_m) > 10
    place = scene.place(float(rng.uniform(0.4 if dense else 0.6, 0.97)))
    above, below, loss = (float(rng.uniform(*r)) for r in ((10, 18), (7, 14), (0.1, 0.4)))
    taken = 0.0
    if rng.random() < 0.5:  # what passes loses an energy, the same for all, instead of a share of v
        loss, taken = 0.0, float(rng.uniform())
    row = force_row(Kind.DAM, place, above, below, loss, 6.0, taken)
    details = {
        "width_above_m": above,
        "width_below_m": below,
        "loss_exponent": 2.0 * loss,
        "share_taken": taken,
    }
    around = (place - above, place + below)
    return Effect("obstacle", "height", "m", 0.7, 25.0, even(scene), row=row, place_m=around, details=details)


def _segment_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    place, edge = draw_stretch(rng, scene), float(rng.uniform(10, 30))
    exponent = float(rng.uniform(1.7, 2.2))
    row = force_row(Kind.STRETCH_DRAG, *place, edge, exponent, float(rng.uniform(0, 6)))
    details = {"exponent": exponent, "edge_m": edge}
    return Effect(
        "segment_drag", "D_f", "m-1", 1e-4, 1.5e-2, even(scene), row=row, place_m=place, details=details
    )


def _segment_friction(rng: np.random.Generator, scene: Scene) -> Effect:
    place, edge, sign = draw_stretch(rng, scene), float(rng.uniform(10, 30)), float(rng.choice([-1.0, 1.0]))
    row = force_row(Kind.STRETCH_FRICTION, *place, edge)
    return Effect(
        "segment_friction", "b_f", "m s-2", 0.05, 4.0 if sign > 0 else 2.0, even(scene), sign=sign, row=row,
        place_m=place, details={"edge_m": edge},
    )  # fmt: skip


def _entrainment(rng: np.random.Generator, scene: Scene) -> Effect:
    place, edge = draw_stretch(rng, scene, 150.0, 500.0), float(rng.uniform(15, 40))
    threshold = float(rng.uniform(6, 14))
    row = force_row(Kind.EROSION, *place, edge, threshold, 2.5)
    details = {"threshold_m_s": threshold, "edge_m": edge}
    return Effect(
        "entrainment", "growth", "m-1", 1e-4, 1.5e-2, even(scene), row=row, place_m=place, details=details
    )


@dataclass(frozen=True)
class Response:
    """How friction answers to a covariate: saturating, standardised over the events of the trial.

    Attributes
    ----------
    covariate : str
    centre, scale : float
        Of the covariate, of its logarithm for a volume.
    saturation : float
    offset, spread : float
        Of the response to it.
    """

    covariate: str
    centre: float
    scale: float
    saturation: float
    offset: float
    spread: float

    def __call__(self, rng: np.random.Generator, covariates: Mapping[str, FloatArray], n: int) -> FloatArray:
        """The weights of avalanches with some covariates."""
        score = (_on_scale(self.covariate, covariates) - self.centre) / self.scale
        response = np.tanh(self.saturation * score) / self.saturation
        return np.asarray((response - self.offset) / self.spread)


def _on_scale(name: str, covariates: Mapping[str, FloatArray]) -> FloatArray:
    return np.log(covariates[name]) if name == "release_volume_m3" else covariates[name]


def _covariate_friction(rng: np.random.Generator, scene: Scene) -> Effect:
    name = str(rng.choice(sorted(scene.covariates)))
    values = _on_scale(name, scene.covariates)
    saturation = float(rng.choice([0.05, 0.7, 1.4]))
    plain = Response(name, float(values.mean()), float(values.std()), saturation, 0.0, 1.0)
    response = plain(rng, scene.covariates, scene.n_events)
    weigh = replace(plain, offset=float(response.mean()), spread=float(response.std()))
    return Effect(
        "covariate_friction", "log friction per standard deviation", "1", 0.01, 0.4,
        weigh(rng, scene.covariates, scene.n_events),
        sign=float(rng.choice([-1.0, 1.0])), target="friction",
        details={"covariate": name, "saturation": saturation}, weigh=weigh,
    )  # fmt: skip


def _sensor_bias(rng: np.random.Generator, scene: Scene) -> Effect:
    sensor = int(rng.integers(len(scene.setting.sensors.s_from_m)))
    return Effect(
        "sensor_bias", "log factor", "1", 0.01, 0.5, even(scene), sign=float(rng.choice([-1.0, 1.0])),
        target="sensor", sensor=sensor,
    )  # fmt: skip


def _sensor_place(rng: np.random.Generator, scene: Scene) -> Effect:
    sensors, sign = scene.setting.sensors, float(rng.choice([-1.0, 1.0]))
    sensor = int(rng.integers(len(sensors.s_from_m)))
    # it stays where the typical avalanche comes by
    above = float(sensors.s_from_m[sensor]) - scene.place(0.05)
    below = scene.place(0.97) - float(sensors.s_to_m[sensor])
    if (below if sign > 0 else above) < 10.0:
        sign = -sign
    high = float(np.clip(below if sign > 0 else above, 10.0, 200.0))
    return Effect(
        "sensor_place", "shift", "m", 2.0, high, even(scene), sign=sign, target="place", sensor=sensor
    )


def _release_offset(rng: np.random.Generator, scene: Scene) -> Effect:
    sign = float(rng.choice([-1.0, 1.0]))
    setting = scene.setting
    margin = 2.5 * setting.release_sd_m + 10.0
    # no front starts above the track or below a sensor
    above = float(setting.releases_m.min()) - margin
    below = float(setting.sensors.s_from_m.min() - setting.releases_m.max()) - margin
    high = float(np.clip(below if sign > 0 else above, 10.0, 150.0))
    return Effect("release_offset", "offset", "m", 2.0, high, even(scene), sign=sign, target="release")


LISTED: dict[str, Draw] = {
    "coulomb_friction": _coulomb_friction,
    "centrifugal": _centrifugal,
    "turbulent_drag": _turbulent_drag,
    "viscous_drag": _viscous_drag,
    "constant_retardation": _constant_retardation,
    "velocity_weakening": _velocity_weakening,
    "obstacle": _obstacle,
    "segment_drag": _segment_drag,
    "segment_friction": _segment_friction,
    "entrainment": _entrainment,
    "covariate_friction": _covariate_friction,
    "sensor_bias": _sensor_bias,
    "release_offset": _release_offset,
    "sensor_place": _sensor_place,
}
INSTRUMENT = ("sensor_bias", "release_offset", "sensor_place")
OF_RECORD = INSTRUMENT[:2]
"""Faults that are drawn where none is asked for: those there were when the seeds of the record were drawn."""
PHYSICS = tuple(name for name in LISTED if name not in INSTRUMENT)

_BASES: dict[str, tuple[str, ...]] = {
    "coulomb_friction": ("constant",),
    "centrifugal": ("voellmy",),
    "turbulent_drag": ("coulomb", "constant"),
    "constant_retardation": ("pcm", "coulomb", "voellmy"),
    "velocity_weakening": ("pcm", "coulomb", "voellmy"),
}
"""Base laws that lack an effect; all, where there is no entry."""
BASES = {"pcm": 0.4, "voellmy": 0.25, "coulomb": 0.2, "constant": 0.15}
"""How often each base law is drawn."""


def fits(effect: str, base: str) -> bool:
    """Whether a base law lacks this effect."""
    return base in _BASES.get(effect, tuple(BASES))
