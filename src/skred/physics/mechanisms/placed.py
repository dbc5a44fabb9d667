"""A mechanism on a campaign: its shapes there and what each of them changes, checked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from skred.errors import InputError
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.library import library
from skred.physics.mechanisms.spec import Added, BoundTo, Direction, Mechanism, Setting, Shape
from skred.physics.mechanisms.strength_prior import SCALES
from skred.physics.plugins import OWN_PACKAGE, in_a_line


@dataclass(frozen=True, eq=False)
class PlacedMechanism:
    """A mechanism of one shape, as it can be added to a law on a campaign.

    Attributes
    ----------
    mechanism : Mechanism
    shape : Shape
    direction : Direction
        What one unit of it changes there.
    """

    mechanism: Mechanism
    shape: Shape
    direction: Direction

    @property
    def added(self) -> Added:
        """How the mechanism is added."""
        return added_of(self.mechanism)

    @property
    def scale(self) -> float:
        """The mechanism's own, which those of the strength's prior are multiples of."""
        return self.added.scale_of(self.shape)

    @property
    def widest(self) -> float:
        """The widest scale of the strength's prior."""
        return SCALES[-1] * self.scale

    @property
    def relevant(self) -> float:
        """Median of the prior of its size."""
        return self.added.relevant * self.shape.prior_scales

    @property
    def with_speed(self) -> bool:
        """Whether it enters with U itself: its fronts take the kernel four times as long as others."""
        return bool({Column.LINEAR, Column.WEAKENING} & set(self.direction.columns))


def placed(mechanism: Mechanism, setting: Setting, shape: Shape) -> PlacedMechanism:
    """A mechanism on a campaign; raises as `shapes_of`."""
    return PlacedMechanism(mechanism, shape, direction_of(mechanism, setting, shape))


def can_join(mechanism: Mechanism, base: tuple[str, ...]) -> bool:
    """Whether a mechanism can be missing from a base law that has these; raises as `shapes_of`."""
    if mechanism.added is None:
        return False
    with _named(mechanism):
        return bool(mechanism.added.joins(base))


def shapes_of(mechanism: Mechanism, setting: Setting) -> tuple[Shape, ...]:
    """Shapes that a mechanism is looked for in; none where the recordings lack a covariate that it needs.

    Raises
    ------
    InputError
        If a mechanism of another package fails, or its shapes are not what it says that it is bound to.
    """
    added = added_of(mechanism)
    if not set(added.needs) <= set(setting.covariates):
        return ()
    with _named(mechanism):
        shapes = tuple(added.shapes(setting))
        for shape in shapes:
            _check_shape(added, shape, setting)
    return shapes


def parts_of(mechanism: Mechanism, setting: Setting, shape: Shape, steps: float) -> tuple[Shape, ...]:
    """Finer shapes around one; raises as `shapes_of`."""
    added = added_of(mechanism)
    with _named(mechanism):
        parts = tuple(added.split(setting, shape, steps))
        for part in parts:
            _check_shape(added, part, setting)
    return parts


def direction_of(mechanism: Mechanism, setting: Setting, shape: Shape) -> Direction:
    """What one unit of the mechanism changes on a campaign; raises as `shapes_of`."""
    with _named(mechanism):
        direction = added_of(mechanism).direction(setting, shape)
        _check_direction(direction, setting)
    return direction


def added_of(mechanism: Mechanism) -> Added:
    """How a mechanism that can be added to a law is added.

    Raises
    ------
    ValueError
        If it cannot be.
    """
    if mechanism.added is None:
        raise ValueError(f"{mechanism.id} cannot be added to a law")
    return mechanism.added


@contextmanager
def _named(mechanism: Mechanism) -> Iterator[None]:
    """Say whose mechanism it is that fails; an error of our own stays what it is."""
    try:
        yield
    except Exception as error:
        package = library().packages.get(mechanism.id, OWN_PACKAGE)
        if package == OWN_PACKAGE:
            raise
        name = f"the mechanism {mechanism.id!r} of the package {package}"
        raise InputError(f"{name} fails: {in_a_line(error)}") from error


def _check_shape(added: Added, shape: Shape, setting: Setting) -> None:
    """Refuse a shape that does not name what the mechanism is bound to, or names what is not there."""
    named = {
        BoundTo.PLACE: shape.s_from_m is not None and shape.s_to_m is not None,
        BoundTo.SENSOR: shape.sensor is not None,
        BoundTo.COVARIATE: shape.covariate is not None,
    }
    for bound_to, is_named in named.items():
        if is_named is not (added.bound_to is bound_to):
            raise ValueError(
                f"expected a shape that is bound to {added.bound_to}, found one"
                f" {'' if is_named else 'not '}bound to {bound_to}"
            )
    if shape.s_to_m is not None and shape.s_from_m is None:
        raise ValueError("expected a shape that ends somewhere to begin somewhere")
    if named[BoundTo.PLACE] and not shape.s_from_m < shape.s_to_m:  # type: ignore[operator]
        raise ValueError(
            f"expected a stretch to begin above its end, found {shape.s_from_m} to {shape.s_to_m}"
        )
    if shape.sensor is not None and shape.sensor not in setting.sensors:
        raise ValueError(f"no sensor {shape.sensor!r}")
    if shape.covariate is not None and shape.covariate not in setting.covariates:
        raise ValueError(f"no covariate {shape.covariate!r} that varies; name it in `needs`")


def _check_direction(direction: Direction, setting: Setting) -> None:
    """Refuse arrays of another size than campaign and track have: the kernel would not notice."""
    n_columns, n_cells = len(direction.columns), setting.terrain.n_cells
    if not all(isinstance(column, Column) for column in direction.columns):
        raise TypeError("columns: expected members of Column")
    arrays = {
        "profiles": (direction.profiles if n_columns else None, (n_columns, n_cells)),
        "log_strengths": (direction.log_strengths, (setting.n_events,)),
        "log_readings": (direction.log_readings, (len(setting.sensors),)),
        "places": (direction.places, (len(setting.sensors),)),
    }
    for name, (values, expected) in arrays.items():
        if values is not None and (np.shape(values) != expected or not np.isfinite(values).all()):
            raise ValueError(f"{name}: expected finite numbers of shape {expected}, found {np.shape(values)}")
    if not np.isfinite(direction.release):
        raise ValueError("release: expected a finite number")
    if (direction.weakening_speed is not None) is not (Column.WEAKENING in direction.columns):
        raise ValueError("weakening_speed: expected with the column WEAKENING, and only with it")
