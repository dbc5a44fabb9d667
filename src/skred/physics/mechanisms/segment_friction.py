"""Another surface on a stretch: extra retardation that does not depend on speed, of either sign."""

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Added, BoundTo, Mechanism, Strength
from skred.physics.mechanisms.stretches import along_a_stretch, split_stretch, stretches

MECHANISM = Mechanism(
    id="segment_friction",
    title="another surface on a stretch: bare ground, ice, deposit",
    strength=Strength(
        name="segment_friction",
        symbol="b_f",
        unit="m s-2",
        prior_scale=1.2,
        prior_reason="a change of dry friction by 0.13 on a gentle slope",
    ),
    equation="-b_f for s_1 < s < s_2",
    signature="every front loses, or gains, the same U^2/2 on the stretch; slow ones stop there",
    reference="Perla, Cheng and McClung (1980), Journal of Glaciology 26(94), 197-207: friction by segment",
    doi="10.3189/S002214300001073X",
    added=Added(
        scale=1.2,
        reason="a change of dry friction by 0.13 on a gentle slope",
        direction=along_a_stretch(Column.CONSTANT),
        shapes=stretches,
        bound_to=BoundTo.PLACE,
        split=split_stretch,
        either_sign=True,
    ),
)
