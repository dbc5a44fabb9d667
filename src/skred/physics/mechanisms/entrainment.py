"""Mass picked up from a snow cover at rest, where there is snow to erode.

At a constant rate by mass it is the term of extra drag, and computed as that. Its own is the form in which
every metre of a stretch adds as much snow: the more a front has taken, the less that counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Added, BoundTo, Direction, Mechanism, Setting, Shape, Strength
from skred.physics.mechanisms.stretches import (
    along_a_stretch,
    ends_of,
    split_stretch,
    stretches,
    stretches_of_drag,
)

GROWTH = "m_2/m_1 [1]"
"""How many times the mass is larger at the end of the stretch than at its beginning."""
DOUBLED = 2.0
"""By which growth the form is taken: in large avalanches mass has been seen to double and more."""


def _shapes(setting: Setting) -> tuple[Shape, ...]:
    """The stretches of drag, and those on which every metre adds as much."""
    limited = [replace(one, constants=((GROWTH, DOUBLED),)) for one in stretches(setting)]
    return (*stretches_of_drag(setting), *limited)


def _direction(setting: Setting, shape: Shape) -> Direction:
    """As drag; where every metre adds as much, in proportion to 1 over the mass so far."""
    growth = dict(shape.constants).get(GROWTH)
    if growth is None:
        return along_a_stretch(Column.QUADRATIC)(setting, shape)
    mass = np.interp(setting.terrain.middle_s_m, ends_of(shape), (1.0, growth))
    return Direction((Column.QUADRATIC,), (setting.terrain.share_between(*ends_of(shape)) / mass)[None, :])


MECHANISM = Mechanism(
    id="entrainment",
    title="snow at rest picked up on a stretch",
    strength=Strength(
        name="entrainment_rate",
        symbol="e",
        unit="m-1",
        prior_scale=2e-3,
        prior_reason="over 350 m the scale doubles the mass",
    ),
    equation="-(1/m)(dm/ds) U^2 with (1/m)(dm/ds) = e m_1/m for s_1 < s < s_2, m growing alike with s",
    signature="as drag on a stretch, where mass grows at a constant rate the same term, unless it was"
    " measured; a little more at the beginning where every metre adds as much",
    reference="Sovilla, Burlando and Bartelt (2006), Journal of Geophysical Research 111, F03007",
    doi="10.1029/2005JF000391",
    added=Added(
        scale=2e-3,
        reason="over 350 m the scale doubles the mass",
        direction=_direction,
        shapes=_shapes,
        bound_to=BoundTo.PLACE,
        split=split_stretch,
    ),
    same_term_as="segment_drag",
)
