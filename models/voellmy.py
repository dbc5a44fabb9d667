"""The Voellmy-Salm model: dry friction without curvature, and drag g U^2 / (xi h).

    dU^2/(2 ds) = g sin(phi) - mu g cos(phi) - g U^2 / (xi h)

A block model sees only the product xi h [m2/s2]; xi itself is shown for a declared flow depth h.
Run it: ``python -m models.voellmy``.
"""

from typing import Any

from skred.physics.kernel.columns import GRAVITY
from skred.physics.law import Law, Parameter, parameter_of
from skred.physics.mechanisms import coulomb_friction, turbulent_drag

DRY = coulomb_friction.WITHOUT_CURVATURE
DRAG = turbulent_drag.MECHANISM
FLOW_DEPTH_M = 1.5
"""h [m], for display only: xi = (xi h) / h."""
XI_H_MEDIAN, XI_H_LOG_SD = 2000.0, 1.0
"""Prior of xi h: 95 % in 280-14 000 m2/s2, xi of 400-3000 m/s2 at depths of 0.7-5 m."""


def strengths(mu: Any, xi_h: Any) -> tuple[Any, Any]:
    """Strengths of the mechanisms: D = g / (xi h)."""
    return mu, GRAVITY / xi_h


def inverse(mu: Any, drag: Any) -> tuple[Any, Any]:
    """Parameters of strengths."""
    return mu, GRAVITY / drag


def build(problem: Any) -> Any:
    """PyMC model of a campaign; with `--likelihood hierarchical` priors are of the events' medians."""
    import numpy as np
    import pymc as pm

    with pm.Model(coords=problem.coords) as model:
        mu = pm.HalfNormal("dry_friction", sigma=DRY.strength.prior_scale)
        xi_h = pm.LogNormal("xi_h", mu=np.log(XI_H_MEDIAN), sigma=XI_H_LOG_SD)
        pm.Deterministic("xi", xi_h / FLOW_DEPTH_M)
        problem.observe(LAW.mechanisms, strengths(mu, xi_h))
    return model


LAW = Law(
    id="voellmy",
    title="Voellmy-Salm: dry friction without curvature and turbulent drag",
    mechanisms=(DRY, DRAG),
    parameters=(parameter_of(DRY.strength), Parameter("xi_h", "xi h", "m2 s-2")),
    build=build,
    reference="Voellmy (1955); Salm (1993), Annals of Glaciology 18, 221-226",
    strengths=strengths,
    inverse=inverse,
    derived=(Parameter("xi", "xi", "m s-2"),),
    relation="D = g / (xi h)",
)

if __name__ == "__main__":
    from skred.cli.run_model import run_model

    run_model("voellmy")
