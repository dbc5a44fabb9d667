"""Dry friction, with and without the track's curvature in the normal force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.mechanisms.spec import (
    Added,
    Mechanism,
    Strength,
    along_the_track,
    everywhere,
    lacking,
    whole_or_recorded,
)
from skred.physics.terrain import Terrain

DRY_FRICTION = Strength(
    name="dry_friction",
    symbol="mu",
    paper_symbol="a0",
    unit="1",
    prior_scale=0.5,
    prior_reason="tangent of the friction angle; 95 % below 1.0 (45 degrees), snow rarely exceeds 0.6",
)

MECHANISM = Mechanism(
    id="coulomb_friction",
    title="dry friction, curvature included",
    strength=DRY_FRICTION,
    equation="-mu max(0, g cos(phi) + kappa U^2)",
    signature="retardation that does not depend on speed on a straight slope",
    reference="Mougin (1922); Bartelt, Salm and Gruber (1999), Journal of Glaciology 45(150), 242-254",
    doi="10.3189/S002214300000174X",
    column=Column.FRICTION,
    profile=everywhere,
    added=Added(
        scale=0.2,
        reason="an ordinary friction coefficient of snow is 0.15-0.4; part of it a base law may hold already",
        direction=along_the_track(Column.FRICTION, everywhere),
        shapes=whole_or_recorded,
        joins=lacking("coulomb_friction", "coulomb_friction_without_curvature"),
    ),
)


def _on_a_straight_slope(terrain: Terrain) -> NDArray[np.float64]:
    return GRAVITY * terrain.cos_slope


WITHOUT_CURVATURE = replace(
    MECHANISM,
    id="coulomb_friction_without_curvature",
    title="dry friction, curvature left out",
    equation="-mu g cos(phi)",
    column=Column.CONSTANT,
    profile=_on_a_straight_slope,
    added=None,
)
"""As in the Voellmy-Salm law; its missing part is the mechanism `centrifugal`."""
