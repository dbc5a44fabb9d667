"""Friction that falls with speed, in excess of its value at high speed."""

from dataclasses import replace

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import (
    Added,
    Direction,
    Mechanism,
    Setting,
    Shape,
    Strength,
    along_the_track,
    everywhere,
    lacking,
    whole_or_recorded,
)

U_C = "U_c [m s-1]"
SPEEDS_M_S = (4.0, 8.0, 15.0)


def _shapes(setting: Setting) -> tuple[Shape, ...]:
    constants = [((U_C, speed),) for speed in SPEEDS_M_S]
    return tuple(replace(shape, constants=one) for shape in whole_or_recorded(setting) for one in constants)


def _direction(setting: Setting, shape: Shape) -> Direction:
    direction = along_the_track(Column.WEAKENING, everywhere)(setting, shape)
    return replace(direction, weakening_speed=dict(shape.constants)[U_C])


MECHANISM = Mechanism(
    id="velocity_weakening",
    title="friction that falls with speed",
    strength=Strength(
        name="weakening_friction",
        symbol="mu_s",
        unit="1",
        prior_scale=0.2,
        prior_reason="slow snow may rub half as much again as fast snow",
    ),
    equation="-mu_s g cos(phi) / (1 + U/U_c)",
    signature="slow fronts stop short of what fast ones promise; the last metres retard most",
    reference="Bartelt, Salm and Gruber (1999), Journal of Glaciology 45(150), 242-254, on friction",
    doi="10.3189/S002214300000174X",
    column=Column.WEAKENING,
    profile=everywhere,
    added=Added(
        scale=0.2,
        reason="slow snow may rub half as much again as fast snow; U_c of 4, 8 and 15 m/s, integrated over",
        direction=_direction,
        shapes=_shapes,
        joins=lacking("velocity_weakening"),
    ),
)
