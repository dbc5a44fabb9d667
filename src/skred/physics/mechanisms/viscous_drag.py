"""Drag linear in speed."""

from skred.physics.columns import Column
from skred.physics.mechanisms.spec import Mechanism, Strength, everywhere

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
    mark="between constant and quadratic: hard to tell from turbulent drag",
    reference="Salm (1966); Nishimura and Maeno (1989), Annals of Glaciology 13, 207-210",
    doi="10.3189/S0260305500007916",
    column=Column.LINEAR,
    profile=everywhere,
)
