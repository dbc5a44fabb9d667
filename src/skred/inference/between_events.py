"""How an added strength differs between avalanches: in common, log-normally, or in some of them only.

Each way is a mixture over what an avalanche has of the strength: multiples of it, and the share of avalanches
that have each. One number says how they differ: the sd of the logarithm, or the share that has any.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit

from skred.arrays import FloatArray

SPREAD_MEDIAN, SPREAD_LOG_SD = 0.4, 0.6
"""Median of the prior of the sd of log strengths, and sd of its logarithm: an effect that differs by less
than a tenth is in common for all that recordings tell, and one that differs tenfold is present in some."""
_Z = np.linspace(-3.0, 3.0, 73)
"""Where a normal density is summed, in standard deviations: a twelfth of one apart, so that an avalanche that
tells its own strength to a tenth is not missed between two where they differ by up to a factor of three."""
_FARTHEST = 50.0
"""Largest logarithm of a multiple: beyond all tables, and powers of it stay finite."""
_LOG_Z_SHARES = -0.5 * _Z**2 - math.log(float(np.sum(np.exp(-0.5 * _Z**2))))
"""Of the normal density, at these places."""


class BetweenEvents(StrEnum):
    """How an added strength differs between avalanches."""

    COMMON = "common"
    """The same in all."""
    SPREAD = "spread"
    """Log-normal: the strength is its median."""
    SOME = "some"
    """Present in a share of them, and the same in these."""

    @property
    def parameter(self) -> str:
        """What the name of its own parameter ends with; empty where it has none."""
        return {"common": "", "spread": "spread", "some": "share"}[self.value]


PRIOR = {BetweenEvents.COMMON: 0.5, BetweenEvents.SPREAD: 0.25, BetweenEvents.SOME: 0.25}
"""Prior probability of each way, if a mechanism is there: the simplest as often as both others."""


def components(kind: BetweenEvents, strengths: FloatArray, parameter: FloatArray) -> tuple[FloatArray, ...]:
    """Strengths that avalanches have, and log shares of them that have each, (n, n_components) both.

    Parameters
    ----------
    strengths, parameter : (n,) arrays
        The parameter is not looked at where the strength is in common.
    """
    if kind is BetweenEvents.COMMON:
        return strengths[:, None], np.zeros((len(strengths), 1))
    if kind is BetweenEvents.SOME:
        with np.errstate(divide="ignore"):
            shares = np.column_stack([np.log1p(-parameter), np.log(parameter)])
        return np.column_stack([np.zeros(len(strengths)), strengths]), shares
    multiples = np.exp(np.clip(np.multiply.outer(parameter, _Z), -_FARTHEST, _FARTHEST))
    return strengths[:, None] * multiples, np.tile(_LOG_Z_SHARES, (len(strengths), 1))


def symbolic_components(kind: BetweenEvents, strength: Any, parameter: Any) -> tuple[Any, Any]:
    """As `components`, of one symbolic strength: two vectors."""
    import pytensor.tensor as pt

    if kind is BetweenEvents.COMMON:
        return pt.stack([strength]), pt.zeros(1)
    if kind is BetweenEvents.SOME:
        log_shares = pt.stack([pt.log1p(-parameter), pt.log(parameter)])
        return pt.stack([pt.zeros_like(strength), strength]), log_shares
    logarithms = pt.clip(parameter * pt.constant(_Z), -_FARTHEST, _FARTHEST)
    return strength * pt.exp(logarithms), pt.constant(_LOG_Z_SHARES)


def variable(kind: BetweenEvents, name: str) -> Any:
    """Its own parameter as a random variable of the current PyMC model; None where it has none."""
    import pymc as pm

    if kind is BetweenEvents.SPREAD:
        return pm.LogNormal(name, mu=math.log(SPREAD_MEDIAN), sigma=SPREAD_LOG_SD)
    return pm.Beta(name, 1.0, 1.0) if kind is BetweenEvents.SOME else None


def from_unbounded(kind: BetweenEvents, coordinate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The parameter from a coordinate without bounds, and the log prior density of that coordinate."""
    if kind is BetweenEvents.SPREAD:
        z = (coordinate - math.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD
        return np.exp(coordinate), -0.5 * z**2 - math.log(SPREAD_LOG_SD) - 0.5 * math.log(2.0 * math.pi)
    log_density: FloatArray = -np.logaddexp(0.0, coordinate) - np.logaddexp(0.0, -coordinate)
    return expit(coordinate), log_density


def own_multiples(
    kind: BetweenEvents, parameter: ArrayLike, shape: tuple[int, ...], rng: np.random.Generator
) -> FloatArray:
    """What avalanches to come have of a strength, as multiples of it.

    Parameters
    ----------
    parameter : array or float
        Broadcast to the shape from its first axis on.
    """
    if kind is BetweenEvents.COMMON:
        return np.ones(shape)
    given = np.reshape(parameter, np.shape(parameter) + (1,) * (len(shape) - np.ndim(parameter)))
    if kind is BetweenEvents.SOME:
        return (rng.random(shape) < given).astype(float)
    multiples: FloatArray = np.exp(given * rng.standard_normal(shape))
    return multiples
