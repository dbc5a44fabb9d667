"""Hidden effects that no list has; `nearest` names the listed one that may pass for it, if there is one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.simulator.effects import Effect, force_row
from skred.simulator.forces import Kind
from skred.simulator.listed import Draw, draw_stretch, even
from skred.simulator.scene import Scene


def _unlisted(
    name: str, parameter: str, unit: str, low: float, high: float, weight: FloatArray, row: FloatArray,
    *, sign: float = 1.0, retuned: bool = False, place_m: tuple[float, float] | None = None,
    nearest: str | None = None, **details: Any,
) -> Effect:  # fmt: skip
    return Effect(
        name, parameter, unit, low, high, weight, sign=sign, listed=False, row=row, retuned=retuned,
        place_m=place_m, details={"nearest": nearest, **details},
    )  # fmt: skip


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _cubic_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    """Drag with the third power of the speed on a stretch."""
    place = draw_stretch(rng, scene, 150.0, 400.0)
    row = force_row(Kind.STRETCH_DRAG, *place, 25.0, 3.2, 0.0)
    return _unlisted(
        "cubic_drag", "D_f at 20 m/s", "m-1", 1e-4, 1.5e-2, even(scene), row, place_m=place,
        nearest="segment_drag",
    )  # fmt: skip


def _root_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    """Retardation with the square root of the speed on a stretch."""
    place = draw_stretch(rng, scene, 150.0, 400.0)
    row = force_row(Kind.STRETCH_DRAG, *place, 25.0, 0.5, 0.0)
    return _unlisted(
        "root_drag", "D_f at 20 m/s", "m-1", 1e-4, 1.5e-2, even(scene), row, place_m=place,
        nearest="segment_friction",
    )  # fmt: skip


def _travelled_friction(rng: np.random.Generator, scene: Scene) -> Effect:
    """Friction that fades, or grows, with the distance travelled."""
    scale = float(rng.uniform(0.35, 0.7)) * (scene.runout_m - scene.nominal_release_m)
    row = force_row(Kind.TRAVELLED, scale, 0.45)
    return _unlisted(
        "travelled_friction", "mu", "1", 0.01, 0.3, even(scene), row, sign=_sign(rng), retuned=True,
        scale_m=scale,
    )  # fmt: skip


def _wave(rng: np.random.Generator, scene: Scene) -> Effect:
    """Force periodic along the track."""
    wavelength = float(rng.uniform(0.18, 0.4)) * (scene.runout_m - scene.nominal_release_m)
    row = force_row(Kind.WAVE, wavelength, float(rng.uniform(0.0, 6.28)))
    return _unlisted(
        "wave", "amplitude", "m s-2", 0.1, 3.0, even(scene), row, retuned=True, wavelength_m=wavelength
    )


def _bend_spreading(rng: np.random.Generator, scene: Scene) -> Effect:
    """Loss in bends seen in plan, in proportion to their curvature and the speed squared."""
    return _unlisted(
        "bend_spreading", "coefficient", "1", 0.03, 2.5, even(scene), force_row(Kind.BEND),
        nearest="segment_drag",
    )  # fmt: skip


def _ageing(rng: np.random.Generator, scene: Scene) -> Effect:
    """Retardation that changes with the time since release."""
    time = float(rng.uniform(0.4, 0.7)) * (scene.runout_m - scene.nominal_release_m) / 22.0
    row = force_row(Kind.AGEING, time, 0.25 * time)
    return _unlisted(
        "ageing", "retardation", "m s-2", 0.05, 2.0, even(scene), row, sign=_sign(rng), retuned=True,
        time_s=time,
    )  # fmt: skip


def _push_pull(rng: np.random.Generator, scene: Scene) -> Effect:
    """Retardation on a stretch and as much push on the next, or the other way round."""
    place = draw_stretch(rng, scene, 200.0, 500.0)
    row = force_row(Kind.PUSH_PULL, place[0], 0.5 * (place[0] + place[1]), place[1], 20.0)
    return _unlisted(
        "push_pull", "retardation", "m s-2", 0.1, 4.0, even(scene), row, sign=_sign(rng), place_m=place
    )


def _threshold_drag(rng: np.random.Generator, scene: Scene) -> Effect:
    """Drag that sets in above a speed."""
    speed = float(rng.uniform(15.0, 25.0))
    return _unlisted(
        "threshold_drag", "D", "m-1", 3e-4, 5e-2, even(scene), force_row(Kind.THRESHOLD, speed), retuned=True,
        speed_m_s=speed,
    )  # fmt: skip


def _in_between(rng: np.random.Generator, covariates: Mapping[str, FloatArray], n: int) -> FloatArray:
    """Weights of avalanches that came in between those of the trial."""
    return rng.uniform(-1.0, 1.0, n)


def _deposit_history(rng: np.random.Generator, scene: Scene) -> Effect:
    """A stretch that earlier avalanches smooth or roughen: its retardation changes sign with their order."""
    place = draw_stretch(rng, scene, 150.0, 400.0)
    order = np.linspace(-1.0, 1.0, scene.n_events)
    row = force_row(Kind.STRETCH_DRAG, *place, 25.0, 1.4, 0.0)
    effect = _unlisted(
        "deposit_history", "D_f at 20 m/s, of the last event", "m-1", 1e-4, 1.5e-2, order, row, place_m=place
    )
    return replace(effect, weigh=_in_between)


UNLISTED: dict[str, Draw] = {
    "cubic_drag": _cubic_drag,
    "root_drag": _root_drag,
    "travelled_friction": _travelled_friction,
    "wave": _wave,
    "bend_spreading": _bend_spreading,
    "ageing": _ageing,
    "push_pull": _push_pull,
    "threshold_drag": _threshold_drag,
    "deposit_history": _deposit_history,
}
