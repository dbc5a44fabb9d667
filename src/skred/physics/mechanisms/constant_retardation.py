"""Speed-independent shear strength: the same retardation everywhere."""

from skred.physics.columns import Column
from skred.physics.mechanisms.spec import Mechanism, Strength, everywhere

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
    mark="the loss of U^2/2 between two places is the same for every event",
    reference="friction limited by a yield stress: Bartelt, Salm and Gruber (1999), J. Glaciology 45(150)",
    doi="10.3189/S002214300000174X",
    column=Column.CONSTANT,
    profile=everywhere,
)
