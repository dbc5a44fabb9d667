"""Drag quadratic in speed, along the whole track."""

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
    id="turbulent_drag",
    title="drag quadratic in speed",
    strength=Strength(
        name="turbulent_drag",
        symbol="D",
        paper_symbol="a2",
        unit="m-1",
        prior_scale=0.01,
        prior_reason="over 1/(2 D) drag alone takes 63 % of U^2; 95 % of D below "
        "0.02 1/m, which on 30 degrees without friction allows no more than 16 m/s",
    ),
    equation="-D U^2",
    signature="fast fronts retard more than slow ones at the same place; speed tends to a limit",
    reference="Voellmy (1955); Perla, Cheng and McClung (1980), Journal of Glaciology 26(94), 197-207",
    doi="10.3189/S002214300001073X",
    column=Column.QUADRATIC,
    profile=everywhere,
    added=Added(
        scale=1.5e-3,
        reason="at 30 m/s the scale retards by 1.35 m/s2, as much as dry friction of 0.15",
        direction=along_the_track(Column.QUADRATIC, everywhere),
        shapes=whole_or_recorded,
        joins=lacking("turbulent_drag"),
    ),
)
