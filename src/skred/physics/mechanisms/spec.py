"""What a mechanism says of itself: one spec that drives models, diagnosis, verdict, command line, reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from skred.arrays import FloatArray
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.strength_prior import MEDIAN
from skred.physics.terrain import Terrain

Profile = Callable[[Terrain], FloatArray]
"""Contribution per unit of a coefficient to a column of the kernel's table, (n_cells,)."""


class Group(StrEnum):
    """What a mechanism says is wrong: the physics or the instruments."""

    PHYSICS = "physics"
    """A term of the equation of motion."""
    INSTRUMENT = "instrument"
    """The recordings."""


class BoundTo(StrEnum):
    """What an added mechanism is bound to; its shapes say to which one. Figures and verdict follow it."""

    TRACK = "track"
    """Nothing in particular: it acts on all avalanches along the track, or from a shape's `s_from_m` on."""
    PLACE = "place"
    """A stretch of the track: every shape has `s_from_m` and `s_to_m`."""
    SENSOR = "sensor"
    """An instrument: every shape has `sensor`."""
    COVARIATE = "covariate"
    """A property of the avalanches: every shape has `covariate`."""


@dataclass(frozen=True)
class Strength:
    """The coefficient of a mechanism: one number that says how strong it is.

    Attributes
    ----------
    name : str
        Name of the parameter in models, tables and files; no other mechanism's.
    symbol : str
        In equations here; no other mechanism's.
    paper_symbol : str
        In the Ryggfonn calibration paper; empty where it has none.
    unit : str
        SI, as ``m s-2``; ``1`` where there is none.
    prior_scale : float
        Scale of its half-normal prior as a part of a base law, in `unit`.
    prior_reason : str
        Why that scale.
    """

    name: str
    symbol: str
    unit: str
    prior_scale: float
    prior_reason: str
    paper_symbol: str = ""


@dataclass(frozen=True, eq=False)
class Setting:
    """What an added mechanism can refer to: a base law on a terrain, and the recordings made there.

    Attributes
    ----------
    terrain : Terrain
    base : tuple of str
        Ids of the base law's mechanisms, in order.
    recorded_m : (float, float)
        First and last place of the track where something was recorded [m].
    sensors : tuple of str
        Ids of the sensors, in order.
    velocities : tuple of bool
        Which of them read a front velocity.
    covariates : mapping
        Covariates of the events by name, (n_events,) each, standardised as
        `skred.diagnosis.evidence.covariates` has it; constant ones left out.
    n_events : int
    front_speed : (n_cells + 1,) array
        Typical speed of the base law's fronts at the cells' edges [m/s]: the root of the mean square over the
        events that come there, 0 where none does.
    """

    terrain: Terrain
    base: tuple[str, ...]
    recorded_m: tuple[float, float]
    sensors: tuple[str, ...]
    velocities: tuple[bool, ...]
    covariates: Mapping[str, FloatArray]
    n_events: int
    front_speed: FloatArray

    @property
    def front_square(self) -> FloatArray:
        """Typical U^2 in each cell [m²/s²], (n_cells,)."""
        squares: FloatArray = 0.5 * (self.front_speed[1:] ** 2 + self.front_speed[:-1] ** 2)
        return squares


@dataclass(frozen=True)
class Shape:
    """One place and way in which an added mechanism may act. All its shapes are integrated over.

    Attributes
    ----------
    s_from_m, s_to_m : float, optional
        The stretch of one that is bound to a place [m]. Without its end: from there on, along the track.
    covariate : str, optional
        The property of the avalanches that one bound to a covariate depends on.
    sensor : str, optional
        The instrument of one that is bound to a sensor.
    constants : tuple of (str, float)
        Other constants by symbol with unit, as ``U_c [m s-1]``; positive numbers.
    prior_scales : float
        How large the coefficient of this shape is, in scales of its mechanism.
    prior_weight : float
        Prior probability of this shape, relative to the mechanism's others.
    """

    s_from_m: float | None = None
    s_to_m: float | None = None
    covariate: str | None = None
    sensor: str | None = None
    constants: tuple[tuple[str, float], ...] = ()
    prior_scales: float = 1.0
    prior_weight: float = 1.0

    @property
    def begins_m(self) -> float | None:
        """From where on it acts along the track [m]; None on a stretch, and along the whole track."""
        return self.s_from_m if self.s_to_m is None else None

    @property
    def place_m(self) -> float | None:
        """Middle of the stretch."""
        if self.s_from_m is None or self.s_to_m is None:
            return None
        return 0.5 * (self.s_from_m + self.s_to_m)


@dataclass(frozen=True, eq=False)
class Direction:
    """What one unit of an added mechanism's coefficient changes. Every part is linear in the coefficient.

    Attributes
    ----------
    columns : tuple of Column
        Columns of the kernel's table that it enters: its form in U.
    profiles : (n_columns, n_cells) array
        What it adds to each of these columns in each cell of the track.
    log_strengths : (n_events,) array or None
        Change of the logarithm of the base law's first coefficient, event by event.
    release : float
        Shift of all release places [m], downhill positive.
    log_readings : (n_sensors,) array or None
        Change of the logarithm of each sensor's readings.
    places : (n_sensors,) array or None
        How much further down than noted each sensor stands [m]; 0 for a runout.
    weakening_speed : float or None
        Its speed scale U_c [m/s] where it enters the column of weakening friction.
    own : (n_events,) array or None
        How much each event has of what it adds to the columns, as multiples; the same for all unless given.
    """

    columns: tuple[Column, ...] = ()
    profiles: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    log_strengths: FloatArray | None = None
    release: float = 0.0
    log_readings: FloatArray | None = None
    places: FloatArray | None = None
    weakening_speed: float | None = None
    own: FloatArray | None = None

    def with_more_sensors(self, n: int) -> Direction:
        """The same beside so many sensors more, after the others, that it leaves alone."""
        padded = [
            None if one is None else np.append(one, np.zeros(n)) for one in (self.log_readings, self.places)
        ]
        return replace(self, log_readings=padded[0], places=padded[1])


def without_parts(setting: Setting, shape: Shape, steps: float) -> tuple[Shape, ...]:
    """Finer shapes of a mechanism that has none."""
    return ()


@dataclass(frozen=True)
class Added:
    """How a mechanism joins a law that leaves it out.

    Attributes
    ----------
    scale : float
        How large its coefficient is, in its unit: the middle scale of the coefficient's prior
        (`strength_prior`), which is half-normal unless `either_sign`.
    reason : str
        Why that scale.
    direction : callable
        Setting and shape to Direction.
    shapes : callable
        Setting to the shapes to integrate over; none where the recordings have nothing to refer to.
    bound_to : BoundTo
        What these shapes name: a place, a sensor, a covariate, or nothing.
    needs : tuple of str
        Covariates that it refers to by name: columns of `events.csv`. It is not looked for in recordings that
        lack one of them.
    either_sign : bool
        Whether the coefficient may be negative.
    joins : callable
        Ids of the base law's mechanisms to whether it can be missing there.
    split : callable
        Setting, shape and steps to finer shapes around it. Steps are 1 around a shape of the screening, and
        less around its parts. A mechanism of a stretch that has it may be anywhere between its shapes: the
        prior of a stretch is uniform in its end and in the logarithm of its length.
    equation : callable, optional
        Shape to its term, where shapes have different ones; by default all have the mechanism's.
    """

    scale: float
    reason: str
    direction: Callable[[Setting, Shape], Direction]
    shapes: Callable[[Setting], tuple[Shape, ...]]
    bound_to: BoundTo = BoundTo.TRACK
    needs: tuple[str, ...] = ()
    either_sign: bool = False
    joins: Callable[[tuple[str, ...]], bool] = lambda base: True
    split: Callable[[Setting, Shape, float], tuple[Shape, ...]] = without_parts
    equation: Callable[[Shape], str] | None = None

    @property
    def moves(self) -> bool:
        """Whether it may be anywhere between its shapes."""
        return self.bound_to is BoundTo.PLACE and self.split is not without_parts

    def scale_of(self, shape: Shape) -> float:
        """How large the coefficient of a shape is."""
        return self.scale * shape.prior_scales

    @property
    def relevant(self) -> float:
        """Median of the prior of its size: a coefficient that matters."""
        return MEDIAN * self.scale


@dataclass(frozen=True)
class Mechanism:
    """One summand of the retardation, or a fault of the instruments that looks like one.

    Attributes
    ----------
    id : str
        Small letters, digits and ``_``; no other mechanism's.
    title : str
        In plain words.
    strength : Strength
    equation : str
        The term as it enters dU^2/(2 ds) = g sin(phi) + a_ret; what is read instead, for a fault.
    signature : str
        Its diagnostic signature: what its presence looks like in recordings.
    reference, doi : str
        Where it comes from; no doi where there is none.
    column : Column, optional
        The column of the kernel's table that it enters as a part of a base law; None where it can only be
        added to one.
    profile : callable, optional
        Terrain to (n_cells,) contribution per unit of the coefficient.
    added : Added, optional
        How it joins a law that leaves it out.
    group : Group
    same_term_as : str
        Id of a mechanism that is the same term by another name, so that no recording tells them apart, in the
        shapes that both have. These are computed once, under that id. It is compared itself only in shapes
        of its own, if it has such.
    """

    id: str
    title: str
    strength: Strength
    equation: str
    signature: str
    reference: str
    doi: str = ""
    column: Column | None = None
    profile: Profile | None = None
    added: Added | None = None
    group: Group = Group.PHYSICS
    same_term_as: str = ""

    def __repr__(self) -> str:
        """One line."""
        strength = self.strength
        return f"<Mechanism {self.id}: {self.title}; {strength.name} {strength.symbol} [{strength.unit}]>"

    def term(self, terrain: Terrain) -> tuple[Column, FloatArray]:
        """Its column and its profile there, as a part of a base law.

        Raises
        ------
        ValueError
            If it can only be added to one.
        """
        if self.column is None or self.profile is None:
            raise ValueError(f"{self.id} can be added to a law, not be a part of a base law")
        return self.column, self.profile(terrain)


def everywhere(terrain: Terrain) -> FloatArray:
    """Profile of a coefficient that acts alike along the whole track."""
    return np.ones(terrain.n_cells)


def one_shape(setting: Setting) -> tuple[Shape, ...]:
    """Shapes of a mechanism that acts alike along the whole track."""
    return (Shape(),)


def each_velocity(setting: Setting) -> tuple[Shape, ...]:
    """Shapes of a fault of one velocity sensor; of a single one it is no fault but a change of all speeds."""
    named = zip(setting.sensors, setting.velocities, strict=True)
    velocities = [name for name, is_velocity in named if is_velocity]
    return tuple(Shape(sensor=name) for name in velocities) if len(velocities) > 1 else ()


def whole_or_recorded(setting: Setting) -> tuple[Shape, ...]:
    """Shapes of a mechanism that acts along the whole track, or from the first recording on.

    Above that recordings tell little more than the speed that fronts come with. What they come through there
    may be other ground, or no ground at all, as a slope that was made up to give them this speed; and a force
    in no list is looked for where something was recorded. Where no speed was read there is the whole track.
    """
    recorded = Shape(s_from_m=setting.recorded_m[0])
    return (Shape(), recorded) if any(setting.velocities) else (Shape(),)


def along_the_track(column: Column, profile: Profile) -> Callable[[Setting, Shape], Direction]:
    """Direction of a mechanism that enters one column with one profile, from where its shape begins on."""

    def direction(setting: Setting, shape: Shape) -> Direction:
        begins = -np.inf if shape.s_from_m is None else shape.s_from_m
        share = setting.terrain.share_between(begins, np.inf)
        return Direction((column,), (share * profile(setting.terrain))[None, :])

    return direction


def lacking(*ids: str) -> Callable[[tuple[str, ...]], bool]:
    """Whether a base law has none of some mechanisms."""
    return lambda base: not set(ids) & set(base)
