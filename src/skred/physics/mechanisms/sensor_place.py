"""One sensor that is not where it was noted."""

import numpy as np

from skred.physics.mechanisms.spec import (
    Added,
    BoundTo,
    Direction,
    Group,
    Mechanism,
    Setting,
    Shape,
    Strength,
    each_velocity,
)

_REASON = "places are read from maps and plans to a few tens of metres"


def _direction(setting: Setting, shape: Shape) -> Direction:
    return Direction(places=np.array([float(name == shape.sensor) for name in setting.sensors]))


MECHANISM = Mechanism(
    id="sensor_place",
    title="one sensor not where it was noted",
    strength=Strength(name="sensor_shift", symbol="d_s", unit="m", prior_scale=30.0, prior_reason=_REASON),
    equation="reading = the front's speed d_s further down than noted, at one sensor",
    signature="readings of one sensor off by what fronts gain or lose over some metres there",
    reference="Berkson (1950), Journal of the American Statistical Association 45, 164-180",
    doi="10.1080/01621459.1950.10483349",
    added=Added(
        scale=30.0,
        reason=_REASON,
        direction=_direction,
        shapes=each_velocity,
        bound_to=BoundTo.SENSOR,
        either_sign=True,
    ),
    group=Group.INSTRUMENT,
)
