"""A calibrated law as figures name it, read off its tree."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from skred.physics.law import Parameter

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class CalibratedLaw:
    """Names of a law and its parameters.

    Attributes
    ----------
    id, title : str
    likelihood : str
        ``pooled`` or ``hierarchical``.
    own : tuple of Parameter
        The law's own parameters.
    parameters : tuple of Parameter
        All that were sampled, the law's own first.
    strengths : tuple of Parameter
        The coefficients of its mechanisms.
    """

    id: str
    title: str
    likelihood: str
    own: tuple[Parameter, ...]
    parameters: tuple[Parameter, ...]
    strengths: tuple[Parameter, ...]


def law_of(tree: xr.DataTree) -> CalibratedLaw:
    """The law that a tree is a calibration of."""
    attributes = tree.attrs
    own, others, strengths = (
        tuple(Parameter(**one) for one in json.loads(attributes[key]))
        for key in ("law_parameters", "population_parameters", "strengths")
    )
    return CalibratedLaw(
        str(attributes["law"]),
        str(attributes["law_title"]),
        str(attributes["likelihood"]),
        own,
        (*own, *others),
        strengths,
    )
