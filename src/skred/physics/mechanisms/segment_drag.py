"""Forest, boulders, roughness: extra drag quadratic in speed on a stretch."""

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Added, BoundTo, Mechanism, Strength
from skred.physics.mechanisms.stretches import along_a_stretch, split_stretch, stretches_of_drag

MECHANISM = Mechanism(
    id="segment_drag",
    title="extra drag on a stretch: forest, boulders, roughness",
    strength=Strength(
        name="segment_drag",
        symbol="D_f",
        unit="m-1",
        prior_scale=2.5e-3,
        prior_reason="over 200 m the scale takes 63 % of U^2",
    ),
    equation="-D_f U^2 for s_1 < s < s_2",
    signature="fast fronts lose more on the stretch than slow ones, in proportion to U^2; few stop there",
    reference="Perla, Cheng and McClung (1980), Journal of Glaciology 26(94), 197-207: drag by segment",
    doi="10.3189/S002214300001073X",
    added=Added(
        scale=2.5e-3,
        reason="over 200 m the scale takes 63 % of U^2",
        direction=along_a_stretch(Column.QUADRATIC),
        shapes=stretches_of_drag,
        bound_to=BoundTo.PLACE,
        split=split_stretch,
    ),
)
