"""What a mechanism says of itself: one spec that drives models, command line, reports, docs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skred.physics.columns import Column
from skred.physics.terrain import Terrain

Profile = Callable[[Terrain], NDArray[np.float64]]
"""Contribution per unit of strength to a column of the coefficient table, (n_cells,)."""


@dataclass(frozen=True)
class Strength:
    """How strong a mechanism is: one non-negative number.

    Attributes
    ----------
    name : str
        Name of the parameter in models, tables and files.
    symbol, paper_symbol : str
        In equations here, and in the Ryggfonn calibration paper.
    unit : str
        SI, ``1`` where there is none.
    prior_scale : float
        Scale of its half-normal prior as a part of a base law, in `unit`.
    prior_reason : str
        Why that scale.
    """

    name: str
    symbol: str
    paper_symbol: str
    unit: str
    prior_scale: float
    prior_reason: str


@dataclass(frozen=True)
class Mechanism:
    """One summand of the retardation.

    Attributes
    ----------
    id : str
        As in the campaign format.
    title : str
        In plain words.
    strength : Strength
    equation : str
        The term as it enters dU^2/(2 ds) = g sin(phi) + a_ret.
    mark : str
        What its presence looks like in recordings.
    reference, doi : str
        Where it comes from.
    column : Column
        The column of the coefficient table that its strength enters.
    profile : callable
        Terrain to (n_cells,) contribution per unit of strength.
    """

    id: str
    title: str
    strength: Strength
    equation: str
    mark: str
    reference: str
    doi: str
    column: Column
    profile: Profile


def everywhere(terrain: Terrain) -> NDArray[np.float64]:
    """Profile of a strength that acts alike along the whole track."""
    return np.ones(terrain.n_cells)
