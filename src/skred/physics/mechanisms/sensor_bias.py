"""One sensor that reads too high or too low by a factor."""

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


def _direction(setting: Setting, shape: Shape) -> Direction:
    return Direction(log_readings=np.array([float(name == shape.sensor) for name in setting.sensors]))


MECHANISM = Mechanism(
    id="sensor_bias",
    title="one sensor reads too high or too low",
    strength=Strength(
        name="log_sensor_factor",
        symbol="a",
        unit="1",
        prior_scale=0.15,
        prior_reason="a calibration that is off by 15 % of the reading",
    ),
    equation="reading = exp(a) times the front's speed, at one sensor",
    signature="equal and opposite work in the two stretches beside the sensor",
    reference="Sargsyan, Najm and Ghanem (2015), International Journal of Chemical Kinetics 47, 246-276",
    doi="10.1002/kin.20906",
    added=Added(
        scale=0.15,
        reason="a calibration that is off by 15 % of the reading",
        direction=_direction,
        shapes=each_velocity,
        bound_to=BoundTo.SENSOR,
        either_sign=True,
    ),
    group=Group.INSTRUMENT,
)
