"""Drag linear in speed."""

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import (
    Added,
    Mechanism,
    Strength,
    along_the_track,
    everywhere,
    lacking,
    whole_or_recorded,
)

MECHANISM = Mechanism(
    id="viscous_drag",
    title="drag linear in speed",
    strength=Strength(
        name="viscous_drag",
        symbol="c",
        paper_symbol="a1",
        unit="s-1",
        prior_scale=0.1,
        prior_reason="at 30 m/s the scale retards by 3 m/s2, as much as dry friction of 0.35",
    ),
    equation="-c U",
    signature="between constant and quadratic: hard to tell from turbulent drag",
    reference="among the flow laws compared by Bartelt, Salm and Gruber (1999), J. Glaciology 45(150)",
    doi="10.3189/S002214300000174X",
    column=Column.LINEAR,
    profile=everywhere,
    added=Added(
        scale=0.05,
        reason="at 30 m/s the scale retards by 1.5 m/s2, as much as dry friction of 0.17",
        direction=along_the_track(Column.LINEAR, everywhere),
        shapes=whole_or_recorded,
        joins=lacking("viscous_drag"),
    ),
)
