"""A hidden effect: what it does, how strong it may be, and how it enters a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from skred.arrays import FloatArray
from skred.simulator.forces import TERM_WIDTH, Kind

Target = Literal["force", "friction", "sensor", "place", "release"]
Weigh = Callable[[np.random.Generator, Mapping[str, FloatArray], int], FloatArray]
"""Weights of further avalanches, from their covariates and their number."""


def evenly(rng: np.random.Generator, covariates: Mapping[str, FloatArray], n: int) -> FloatArray:
    """The same strength for every avalanche."""
    return np.ones(n)


@dataclass(frozen=True, eq=False)
class Effect:
    """Something the base law does not know.

    Attributes
    ----------
    id : str
        Id in the campaign format's list, or a name of its own where `listed` is false.
    parameter, unit : str
        What the strength is.
    low, high : float
        Magnitudes of the strength that are physically plausible.
    sign : float
        Of the strength: 1 or -1.
    target : {"force", "friction", "sensor", "place", "release"}
        What it acts on: the equation of motion, the events' friction (log), one sensor's readings (log
        factor), one sensor's place (m), the release (m).
    row : (12,) array
        For a force: its row, with the strength 1.
    weight : (n_events,) array
        The strength of an event is this times the strength.
    sensor : int
        For a bias or a place: which sensor.
    retuned : bool
        Whether the base friction is chosen anew so that the typical avalanche stops where it did; for
        what acts along the whole track.
    place_m : tuple of float or None
        Where it acts, from and to [m on the true track].
    details : mapping
        What else the truth should tell.
    weigh : callable
        Gives the weights of further avalanches.
    """

    id: str
    parameter: str
    unit: str
    low: float
    high: float
    weight: FloatArray
    sign: float = 1.0
    listed: bool = True
    target: Target = "force"
    row: FloatArray = field(default_factory=lambda: np.zeros(TERM_WIDTH))
    sensor: int = -1
    retuned: bool = False
    place_m: tuple[float, float] | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    weigh: Weigh = evenly


@dataclass(frozen=True, eq=False)
class Hidden:
    """What a set of effects with chosen strengths adds to each event.

    Attributes
    ----------
    terms : (n_events, n_terms, 12) array
        Forces.
    friction : (n_events,) array
        Shift of the log of the first base parameter.
    factor : (n_sensors,) array
        Factor of each sensor's readings; the runout's is 1.
    shift_m : (n_sensors - 1,) array
        How much further down than noted each speed sensor stands.
    release_m : float
        Offset of the true release points from the noted ones.
    """

    terms: FloatArray
    friction: FloatArray
    factor: FloatArray
    shift_m: FloatArray
    release_m: float


def force_row(kind: Kind, *numbers: float) -> FloatArray:
    """Row of a force with the strength 1."""
    row = np.zeros(TERM_WIDTH)
    row[: 2 + len(numbers)] = (float(kind), 1.0, *numbers)
    return row


def hidden_of(effects: Sequence[Effect], strengths: Sequence[float], n_events: int, n_sensors: int) -> Hidden:
    """Combine effects with the magnitudes of their strengths."""
    forces = [pair for pair in zip(effects, strengths, strict=True) if pair[0].target == "force"]
    terms = np.zeros((n_events, len(forces), TERM_WIDTH))
    for k, (effect, strength) in enumerate(forces):
        terms[:, k] = effect.row
        terms[:, k, 1] = effect.sign * strength * effect.weight
    friction, factor, release = np.zeros(n_events), np.ones(n_sensors), 0.0
    shift = np.zeros(n_sensors - 1)
    for effect, strength in zip(effects, strengths, strict=True):
        if effect.target == "friction":
            friction += effect.sign * strength * effect.weight
        elif effect.target == "sensor":
            factor[effect.sensor] *= np.exp(effect.sign * strength)
        elif effect.target == "place":
            shift[effect.sensor] += effect.sign * strength
        elif effect.target == "release":
            release += effect.sign * strength
    return Hidden(terms, friction, factor, shift, release)
