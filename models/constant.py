"""M3, constant retardation: the same shear strength everywhere.

    dU^2/(2 ds) = g sin(phi) - b

b [m/s2] is the paper's a3. Run it: ``python -m models.constant``.
"""

from typing import Any

from skred.physics.law import Law, parameter_of
from skred.physics.mechanisms import constant_retardation

RETARDATION = constant_retardation.MECHANISM


def build(problem: Any) -> Any:
    """PyMC model of a campaign; with `--likelihood hierarchical` the prior is of the events' median."""
    import pymc as pm

    with pm.Model(coords=problem.coords) as model:
        b = pm.HalfNormal("retardation", sigma=RETARDATION.strength.prior_scale)
        problem.observe(LAW.mechanisms, [b])
    return model


LAW = Law(
    id="constant",
    title="M3: constant retardation",
    mechanisms=(RETARDATION,),
    parameters=(parameter_of(RETARDATION.strength),),
    build=build,
    reference="yield stress as in Bartelt, Salm and Gruber (1999), doi 10.3189/S002214300000174X",
)

if __name__ == "__main__":
    from skred.cli.run_model import run_model

    run_model("constant")
