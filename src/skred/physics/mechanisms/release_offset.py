"""All release points noted too high or too low by the same distance."""

from skred.physics.mechanisms.spec import (
    Added,
    Direction,
    Group,
    Mechanism,
    Setting,
    Shape,
    Strength,
    one_shape,
)


def _direction(setting: Setting, shape: Shape) -> Direction:
    return Direction(release=1.0)


MECHANISM = Mechanism(
    id="release_offset",
    title="release points not where they were noted",
    strength=Strength(
        name="release_offset",
        symbol="r",
        unit="m",
        prior_scale=30.0,
        prior_reason="release points are read from maps and photographs to a few tens of metres",
    ),
    equation="the front starts from rest at the noted place plus r",
    signature="fast everywhere, or slow everywhere, most of all above; the same energy for every avalanche",
    reference="Kristensen, Madsen and Jorgensen (2004), Computers and Chemical Engineering 28, 1431-1449",
    doi="10.1016/j.compchemeng.2003.10.001",
    added=Added(
        scale=30.0,
        reason="release points are read from maps and photographs to a few tens of metres",
        direction=_direction,
        shapes=one_shape,
        either_sign=True,
    ),
    group=Group.INSTRUMENT,
)
