"""M1, the Coulomb model: dry friction with the track's curvature in the normal force.

    dU^2/(2 ds) = g sin(phi) - mu max(0, g cos(phi) + kappa U^2)

mu [-] is the paper's a0. Run it: ``python -m models.coulomb``.
"""

from typing import Any

from skred.physics.law import Law, parameter_of
from skred.physics.mechanisms import coulomb_friction

DRY = coulomb_friction.MECHANISM


def build(problem: Any) -> Any:
    """PyMC model of a campaign; with `--likelihood hierarchical` the prior is of the events' median."""
    import pymc as pm

    with pm.Model(coords=problem.coords) as model:
        mu = pm.HalfNormal("dry_friction", sigma=DRY.strength.prior_scale)
        problem.observe(LAW.mechanisms, [mu])
    return model


LAW = Law(
    id="coulomb",
    title="M1: Coulomb, dry friction",
    mechanisms=(DRY,),
    parameters=(parameter_of(DRY.strength),),
    build=build,
    reference="Mougin (1922)",
)

if __name__ == "__main__":
    from skred.cli.run_model import run_model

    run_model("coulomb")
