"""Mass picked up from a snow cover at rest, where there is snow to erode."""

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Added, BoundTo, Mechanism, Strength
from skred.physics.mechanisms.stretches import along_a_stretch, split_stretch, stretches_of_drag

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
    equation="-(1/m)(dm/ds) U^2 with (1/m)(dm/ds) = e for s_1 < s < s_2",
    signature="as drag on a stretch: a permanent tie, unless mass was measured",
    reference="Sovilla, Burlando and Bartelt (2006), Journal of Geophysical Research 111, F03007",
    doi="10.1029/2005JF000391",
    added=Added(
        scale=2e-3,
        reason="over 350 m the scale doubles the mass",
        direction=along_a_stretch(Column.QUADRATIC),
        shapes=stretches_of_drag,
        bound_to=BoundTo.PLACE,
        split=split_stretch,
    ),
    same_term_as="segment_drag",
)
