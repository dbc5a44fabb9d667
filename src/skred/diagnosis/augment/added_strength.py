"""Mechanisms of one shape that are added to a law, their strengths free.

Avalanches may differ in one that is added by itself: what they may have of it, and the share that has each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.coefficient import Curve
from skred.inference.between_events import (
    BetweenEvents,
    components,
    own_multiples,
    symbolic_components,
    variable,
)
from skred.physics.law import Parameter
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.strength_prior import SCALES


@dataclass(frozen=True, eq=False)
class AddedStrength(PlacedMechanism):
    """A mechanism of one shape that is added, its strength free.

    Attributes
    ----------
    name : str
        Of the parameter: the strength's own, numbered if two of a kind are added.
    between : BetweenEvents
        How it differs between avalanches.
    """

    name: str
    between: BetweenEvents = BetweenEvents.COMMON

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its free random variables: the strength, and how it differs between avalanches."""
        strength = self.mechanism.strength
        own = Parameter(self.name, strength.symbol, strength.unit, strength.paper_symbol)
        if self.between is BetweenEvents.COMMON:
            return (own,)
        symbol = {"spread": f"sd(log {strength.symbol})", "some": f"share({strength.symbol})"}[self.between]
        return own, Parameter(self.between_name, symbol, "1")

    @property
    def between_name(self) -> str:
        """Of the parameter that says how it differs between avalanches; empty where it does not."""
        ends = self.between.parameter
        return f"{self.name}_{ends}" if ends else ""


def added_strengths(curves: Sequence[Curve], way: BetweenEvents) -> tuple[AddedStrength, ...]:
    """Of some curves, in which avalanches differ alike; numbered where two have the same name."""
    count: Counter[str] = Counter()
    added = []
    for curve in curves:
        name = curve.mechanism.strength.name
        count[name] += 1
        own = name if count[name] == 1 else f"{name}_{count[name]}"
        added.append(AddedStrength(curve.mechanism, curve.shape, curve.direction, own, way))
    return tuple(added)


def strength_variable(name: str, scale: Any, low: Any, high: Any) -> Any:
    """An added strength under its prior between two values, as PyTensor's numba backend can draw it.

    Above nil where the lower one is 0: with the support's part that is left out, its density is only higher
    by a factor.

    Parameters
    ----------
    scale : float or symbolic
        The mechanism's own (`strength_prior`).
    """
    import pymc as pm
    import pytensor.tensor as pt
    from pymc.distributions.transforms import Interval

    root = np.sqrt(2.0)

    def of_each(scale: Any, low: Any, high: Any) -> tuple[Any, Any, Any]:
        scales = scale * np.array(SCALES)
        return scales, pt.erf(low / scales / root), pt.erf(high / scales / root)

    def drawn(scale: Any, low: Any, high: Any, size: Any) -> Any:
        share, which = pm.Uniform.dist(0.0, 1.0, size=size), pm.Uniform.dist(0.0, 1.0, size=size)
        scales, first, last = of_each(scale, low, high)
        up_to = pt.cumsum(last - first) / pt.sum(last - first)
        k = pt.sum(which[..., None] > up_to[:-1], axis=-1)
        inside = scales[k] * root * pt.erfinv(first[k] + share * (last - first)[k])
        return pt.clip(inside, low, high)

    def logp(value: Any, scale: Any, low: Any, high: Any) -> Any:
        scales, first, last = of_each(scale, low, high)
        density = pt.sum(pt.exp(-0.5 * (value / scales) ** 2) / scales) / pt.sum(last - first)
        log_density = pt.log(density) - 0.5 * np.log(0.5 * np.pi)
        return pt.switch((value >= low) & (value <= high), log_density, -np.inf)

    between = Interval(bounds_fn=lambda *_: (low, high))
    return pm.CustomDist(name, scale, low, high, dist=drawn, logp=logp, default_transform=between)


def components_of(
    added: Sequence[AddedStrength], samples: Mapping[str, Any]
) -> tuple[FloatArray, FloatArray]:
    """Added strengths that avalanches may have, (n, n_components, n_added), and log shares that have each.

    Where nothing differs between avalanches there is one component; they can differ only in what is added by
    itself.

    Parameters
    ----------
    samples : mapping
        Arrays by name of parameter, n values each.
    """
    own, log_shares = zip(*(components(one.between, *_given(one, samples)) for one in added), strict=True)
    return np.stack(own, axis=2), log_shares[0]


def symbolic_components_of(added: Sequence[AddedStrength], strengths: Sequence[Any]) -> tuple[Any, Any]:
    """As `components_of`, of symbolic strengths in the current PyMC model: a matrix and a vector."""
    import pytensor.tensor as pt

    parts = [
        symbolic_components(one.between, strength, variable(one.between, one.between_name))
        for one, strength in zip(added, strengths, strict=True)
    ]
    own, log_shares = zip(*parts, strict=True)
    return pt.stack(own, axis=1), log_shares[0]


def new_rows(
    added: Sequence[AddedStrength], samples: Mapping[str, Any], rng: np.random.Generator, n_avalanches: int
) -> FloatArray:
    """Added strengths of avalanches to come, (n, n_avalanches, n_added): each has its own."""
    columns = []
    for one in added:
        strength, parameter = _given(one, samples)
        own = own_multiples(one.between, parameter, (len(strength), n_avalanches), rng)
        columns.append(strength[:, None] * own)
    return np.stack(columns, axis=2)


def _given(one: AddedStrength, samples: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Draws of a strength, and of what says how it differs: of no meaning where it does not."""
    strength = np.asarray(samples[one.name], dtype=float).ravel()
    if not one.between_name:
        return strength, np.zeros_like(strength)
    return strength, np.asarray(samples[one.between_name], dtype=float).ravel()
