"""Speed-independent shear strength: the same retardation everywhere."""

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
    id="constant_retardation",
    title="constant retardation",
    strength=Strength(
        name="retardation",
        symbol="b",
        paper_symbol="a3",
        unit="m s-2",
        prior_scale=5.0,
        prior_reason="a front moves only while b < g sin(phi) < 9.8 m/s2; 95 % of the prior below that",
    ),
    equation="-b",
    signature="the loss of U^2/2 between two places is the same for every event",
    reference="friction limited by a yield stress: Bartelt, Salm and Gruber (1999), J. Glaciology 45(150)",
    doi="10.3189/S002214300000174X",
    column=Column.CONSTANT,
    profile=everywhere,
    added=Added(
        scale=0.8,
        reason="a shear strength of 200-300 Pa on a metre of snow of 300 kg/m3",
        direction=along_the_track(Column.CONSTANT, everywhere),
        shapes=whole_or_recorded,
        joins=lacking("constant_retardation"),
    ),
)
