"""Mechanisms that act on a stretch of the track: where they are looked for, how they enter, what opposes.

Drag on a stretch may be opposed there: by a smoother or steeper bed, or whatever else gives fronts of the
typical speed back what it takes. On average nothing shows then, and a base law that is right at every sensor
is still wrong for each front that is faster or slower than most. Friction is not looked for so: what would
oppose it, a drag below nil, would push fast fronts without bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from skred.arrays import FloatArray
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Direction, Mechanism, Setting, Shape

STRETCHES_M = (75.0, 200.0, 500.0)
"""Lengths of the stretches that are looked at [m]."""
_STEP_IN_LENGTHS = 0.4
U_1, U_2 = "U_1 [m s-1]", "U_2 [m s-1]"
"""Front speeds at both ends of a stretch at which a relief on it equals the drag; U_0^2 is linear between."""
OPPOSED_SHARE = 0.3
"""Prior probability, among the shapes of a force, that it is opposed.

About what opposed stretches have where all stretches are equally probable.
"""
OPPOSED_SCALES = 3.0
"""Prior scale of a drag that is opposed, in that of one that is not.

U^2 varies by a third or so between fronts: the same work, then, on fronts that are not typical.
"""
_OPPOSED_FROM_M = 150.0
_OTHER_RELIEF = 0.08
"""By how much of its speed a relief may be another than one that equals the drag at the typical speed."""
_LEAST_SPEED = 5.0
"""Front speed [m/s] below which nothing is opposed: fronts are about to stop there."""


def ends_of(shape: Shape) -> tuple[float, float]:
    """Where the stretch of a local mechanism begins and ends [m]."""
    assert shape.s_from_m is not None and shape.s_to_m is not None
    return shape.s_from_m, shape.s_to_m


def along_a_stretch(column: Column) -> Callable[[Setting, Shape], Direction]:
    """Direction of a mechanism that enters one column on the shape's stretch, and of what opposes it."""

    def direction(setting: Setting, shape: Shape) -> Direction:
        share = setting.terrain.share_between(*ends_of(shape))
        if not is_opposed(shape):
            return Direction((column,), share[None, :])
        return Direction((column, Column.CONSTANT), np.array([share, -share * _relief(setting, shape)]))

    return direction


def is_opposed(shape: Shape) -> bool:
    """Whether a relief on the stretch equals the drag at the typical speed."""
    return U_1 in dict(shape.constants)


def equation_of(mechanism: Mechanism, shape: Shape) -> str:
    """A mechanism's term in the equation of motion: of its shape, with what opposes it, where it begins."""
    if mechanism.added is not None and mechanism.added.equation is not None:
        return mechanism.added.equation(shape)
    if shape.begins_m is not None:
        return f"{mechanism.equation} for s > {shape.begins_m:.0f} m"
    return mechanism.equation.replace("U^2", "(U^2 - U_0^2)", 1) if is_opposed(shape) else mechanism.equation


def shares(shapes: Sequence[Shape]) -> FloatArray:
    """Prior probability of each of a mechanism's shapes: by weight; opposed ones share theirs."""
    weights = np.array([shape.prior_weight for shape in shapes])
    opposed = np.array([is_opposed(shape) for shape in shapes])
    if opposed.all() or not opposed.any():
        return weights / weights.sum()
    return np.where(
        opposed,
        OPPOSED_SHARE * weights / weights[opposed].sum(),
        (1.0 - OPPOSED_SHARE) * weights / weights[~opposed].sum(),
    )


def _relief(setting: Setting, shape: Shape) -> FloatArray:
    """U^2 at which the relief equals the drag, in each cell: linear between the stretch's ends."""
    first, last = ends_of(shape)
    constants = dict(shape.constants)
    squares = np.array([constants[U_1], constants[U_2]]) ** 2
    return np.interp(setting.terrain.middle_s_m, [first, last], squares)


def stretches(setting: Setting) -> tuple[Shape, ...]:
    """Stretches of several lengths, overlapping, that end in the recorded part of the track.

    They begin above it too, by up to their length: the first sensor reads what a stretch has done to the
    fronts that come out of it.
    """
    return tuple(shape for length in _lengths(setting) for shape in _row(setting, length))


def stretches_of_drag(setting: Setting) -> tuple[Shape, ...]:
    """The stretches, and the longer ones once more, opposed: on a short one that does too little."""
    plain = stretches(setting)
    opposed = [_opposed(setting, one) for one in plain if np.diff(ends_of(one)) > _OPPOSED_FROM_M]
    return (*plain, *(one for one in opposed if one is not None))


def _lengths(setting: Setting) -> list[float]:
    """Lengths of the stretches that the recorded part has room for [m]."""
    first, last = setting.recorded_m
    return [length for length in STRETCHES_M if length <= 1.2 * (last - first)]


def _row(setting: Setting, length: float) -> list[Shape]:
    """Stretches of one length, overlapping; they share its prior probability, the same for each length."""
    first, last = setting.recorded_m
    n = int(np.ceil((last - first) / (_STEP_IN_LENGTHS * length)))
    ends = np.linspace(first, last, n + 1)[1:]
    found = [Shape(max(float(end) - length, 0.0), float(end)) for end in ends]
    return [replace(one, prior_weight=1.0 / len(found)) for one in found]


def _opposed(setting: Setting, shape: Shape, relief: float = 1.0) -> Shape | None:
    """The stretch with a relief that equals the drag at a multiple of the typical speed; None if all stop."""
    speeds = relief * np.interp(ends_of(shape), setting.terrain.edge_s_m, setting.front_speed)
    if speeds.min() < _LEAST_SPEED:
        return None
    constants = tuple((name, round(float(u), 1)) for name, u in zip((U_1, U_2), speeds, strict=True))
    return replace(shape, constants=constants, prior_scales=OPPOSED_SCALES)


def _relief_of(setting: Setting, shape: Shape) -> float:
    """At how much of the typical speed the relief of an opposed stretch equals the drag."""
    typical = np.interp(ends_of(shape), setting.terrain.edge_s_m, setting.front_speed)
    constants = dict(shape.constants)
    return (constants[U_1] + constants[U_2]) / float(typical.sum())


def split_stretch(setting: Setting, shape: Shape, steps: float) -> tuple[Shape, ...]:
    """The stretch moved by a fifth of its length, times steps, shortened, lengthened.

    If it is opposed so are these, each by as much, and it itself by more and by less.
    """
    first, last = ends_of(shape)
    length, end = steps * (last - first), setting.terrain.length_m
    changes = ((-0.2, -0.2), (0.2, 0.2), (0.15, -0.15), (-0.25, 0.25), (-0.4, 0.0), (0.0, 0.4))
    moved = [
        replace(shape, s_from_m=max(first + before * length, 0.0), s_to_m=min(last + after * length, end))
        for before, after in changes
    ]
    if not is_opposed(shape):
        return tuple(moved)
    relief, other = _relief_of(setting, shape), steps * _OTHER_RELIEF
    opposed = [_opposed(setting, one, relief) for one in moved]
    opposed += [_opposed(setting, shape, relief * factor) for factor in (1.0 - other, 1.0 + other)]
    return tuple(one for one in opposed if one is not None)
