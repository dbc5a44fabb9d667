"""The coefficient table: the only thing the kernel knows about a friction law.

The front of a block model obeys, with v = U^2 and s along the track,

    dv/ds = 2 [ g sin(phi) - b - c U - D v - mu max(0, g cos(phi) + kappa v)
                - w g cos(phi) / (1 + U / U_c) ]

Every mechanism contributes to one or more of these columns; within a cell each is constant.
"""

from __future__ import annotations

from enum import IntEnum

GRAVITY = 9.81
"""Acceleration of gravity [m s-2]."""


class Column(IntEnum):
    """Columns of the coefficient table, in the order the kernel reads them."""

    CONSTANT = 0
    """b [m s-2]: retardation that depends on nothing but the place."""
    LINEAR = 1
    """c [s-1]: retardation per front speed U."""
    QUADRATIC = 2
    """D [m-1]: retardation per U^2."""
    FRICTION = 3
    """mu [-]: friction on the normal force, the track's curvature included."""
    WEAKENING = 4
    """w [-]: friction on g cos(phi) that falls off with speed as 1 / (1 + U / U_c)."""
