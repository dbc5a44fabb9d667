"""Friction that depends on a property of the avalanche: temperature, volume, snow type."""

from skred.physics.mechanisms.spec import Added, BoundTo, Direction, Mechanism, Setting, Shape, Strength


def _shapes(setting: Setting) -> tuple[Shape, ...]:
    return tuple(Shape(covariate=name) for name in setting.covariates)


def _direction(setting: Setting, shape: Shape) -> Direction:
    assert shape.covariate is not None
    return Direction(log_strengths=setting.covariates[shape.covariate])


MECHANISM = Mechanism(
    id="covariate_friction",
    title="friction that goes with a property of the avalanche",
    strength=Strength(
        name="covariate_effect",
        symbol="beta",
        unit="1",
        prior_scale=0.12,
        prior_reason="per standard deviation of the covariate: as much as avalanches differ anyhow",
    ),
    equation="-(exp(beta x) - 1) mu max(0, g cos(phi) + kappa U^2),"
    " x the covariate or its logarithm, standardised; b for mu",
    signature="fronts with a high value of the covariate retard more, or less, all along the track",
    reference="Hooker (2009), Biometrics 65, 928-936: what drives a lack of fit in the equation of motion",
    doi="10.1111/j.1541-0420.2008.01172.x",
    added=Added(
        scale=0.12,
        reason="per standard deviation of the covariate: as much as avalanches differ anyhow",
        direction=_direction,
        shapes=_shapes,
        bound_to=BoundTo.COVARIATE,
        either_sign=True,
    ),
)
