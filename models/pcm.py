"""M2, the PCM model: dry friction with curvature, and drag quadratic in speed.

    dU^2/(2 ds) = g sin(phi) - mu max(0, g cos(phi) + kappa U^2) - D U^2

mu [-] is the paper's a0, D [1/m] its a2. Run it: ``python -m models.pcm``.
"""

from typing import Any

from skred.physics.law import Law, parameter_of
from skred.physics.mechanisms import coulomb_friction, turbulent_drag

DRY = coulomb_friction.MECHANISM
DRAG = turbulent_drag.MECHANISM


def build(problem: Any) -> Any:
    """PyMC model of a campaign; with `--likelihood hierarchical` priors are of the events' medians.

    The priors are half-normal, vague and physical (their reasons stand with the mechanisms); the
    paper's came from an optimisation on the same recordings.
    """
    import pymc as pm

    with pm.Model(coords=problem.coords) as model:
        mu = pm.HalfNormal("dry_friction", sigma=DRY.strength.prior_scale)
        drag = pm.HalfNormal("turbulent_drag", sigma=DRAG.strength.prior_scale)
        problem.observe(LAW.mechanisms, [mu, drag])
    return model


LAW = Law(
    id="pcm",
    title="M2: PCM, dry friction and turbulent drag",
    mechanisms=(DRY, DRAG),
    parameters=(parameter_of(DRY.strength), parameter_of(DRAG.strength)),
    build=build,
    reference="Perla, Cheng and McClung (1980), doi 10.3189/S002214300001073X",
)

if __name__ == "__main__":
    from skred.cli.run_model import run_model

    run_model("pcm")
