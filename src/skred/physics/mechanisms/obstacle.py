"""A dam, a wall, a step at one place: what climbing it takes, what its lee side gives back, what is lost."""

from dataclasses import replace

import numpy as np

from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.mechanisms.spec import (
    Added,
    BoundTo,
    Direction,
    Mechanism,
    Setting,
    Shape,
    Strength,
)

HALF_WIDTH_M = 25.0
"""Length of the climb and of the descent [m]."""
LOSS = "loss [m-1]"
TAKEN = "J/gh [1]"
COSTS = ((LOSS, 0.006), (LOSS, 0.025), (TAKEN, 1.0))
"""What passing costs for good: a share of v, as its exponent per metre of height; or from every front the
same J, as a share of what the climb takes."""
_STEP_M = 40.0


def _shapes(setting: Setting) -> tuple[Shape, ...]:
    first, last = setting.recorded_m
    n = max(int(np.ceil((last - first) / _STEP_M)), 1)
    return tuple(
        Shape(float(place - HALF_WIDTH_M), float(place + HALF_WIDTH_M), constants=(cost,))
        for place in np.linspace(first, last, n + 1)
        for cost in COSTS
        if HALF_WIDTH_M < place < setting.terrain.length_m - HALF_WIDTH_M
    )


def _split(setting: Setting, shape: Shape, steps: float) -> tuple[Shape, ...]:
    assert shape.s_from_m is not None and shape.s_to_m is not None
    return tuple(
        replace(shape, s_from_m=shape.s_from_m + shift, s_to_m=shape.s_to_m + shift)
        for shift in (-_STEP_M * steps / 3.0, _STEP_M * steps / 3.0)
        if shape.s_from_m + shift > 0.0 and shape.s_to_m + shift < setting.terrain.length_m
    )


def _direction(setting: Setting, shape: Shape) -> Direction:
    crown = shape.place_m
    assert crown is not None
    climb = setting.terrain.share_between(crown - HALF_WIDTH_M, crown)
    descent = setting.terrain.share_between(crown, crown + HALF_WIDTH_M)
    slope, cost = GRAVITY / HALF_WIDTH_M, dict(shape.constants)
    if TAKEN in cost:
        profile = slope * (climb - (1.0 - cost[TAKEN]) * descent)
        return Direction((Column.CONSTANT,), profile[None, :])
    loss = cost[LOSS] / (4.0 * HALF_WIDTH_M)
    profiles = np.array([slope * (climb - descent), loss * (climb + descent)])
    return Direction((Column.CONSTANT, Column.QUADRATIC), profiles)


def _equation(shape: Shape) -> str:
    if TAKEN in dict(shape.constants):
        return "-(g h / w) climb around s_o, and J = g h is lost for good: U^2 < 2 g h stops"
    return "-(g h / w) [climb - descent] - (l h / 4 w) U^2 around s_o: U^2 < 2 g h stops"


MECHANISM = Mechanism(
    id="obstacle",
    title="an obstacle: a dam, a wall, a step",
    strength=Strength(
        name="obstacle_height",
        symbol="h",
        unit="m",
        prior_scale=8.0,
        prior_reason="dams and steps that matter to a front of 20-40 m/s are metres to tens of metres high",
    ),
    equation="-(g h / w) [climb - descent] - (l h / 4 w) U^2 around s_o, or -(J / w) climb:"
    " U^2 < 2 g h stops",
    signature="stops pile up in front of it; faster fronts pass and lose a share of U^2, or the same J each",
    reference="Faug, Gauer, Lied and Naaim (2008), Journal of Geophysical Research 113, F03009",
    doi="10.1029/2007JF000854",
    added=Added(
        scale=8.0,
        reason="dams and steps that matter to a front of 20-40 m/s are metres to tens of metres high",
        direction=_direction,
        shapes=_shapes,
        bound_to=BoundTo.PLACE,
        split=_split,
        equation=_equation,
    ),
)
