"""The curvature part of the normal force, where the base law leaves it out."""

import numpy as np
from numpy.typing import NDArray

from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Added, Mechanism, Strength, along_the_track, one_shape
from skred.physics.terrain import Terrain


def _curvature(terrain: Terrain) -> NDArray[np.float64]:
    return np.array(terrain.curvature)


def _friction_without_it(base: tuple[str, ...]) -> bool:
    return "coulomb_friction_without_curvature" in base


MECHANISM = Mechanism(
    id="centrifugal",
    title="curvature in the normal force",
    strength=Strength(
        name="centrifugal_friction",
        symbol="mu_k",
        unit="1",
        prior_scale=0.3,
        prior_reason="as large as the dry friction whose part it is",
    ),
    equation="-mu_k kappa U^2",
    signature="fast fronts retard more in concave bends, as in the transition to the runout",
    reference="Perla, Cheng and McClung (1980), Journal of Glaciology 26(94), 197-207",
    doi="10.3189/S002214300001073X",
    column=Column.QUADRATIC,
    profile=_curvature,
    added=Added(
        scale=0.3,
        reason="as large as the dry friction whose part it is",
        direction=along_the_track(Column.QUADRATIC, _curvature),
        shapes=one_shape,
        joins=_friction_without_it,
    ),
)
