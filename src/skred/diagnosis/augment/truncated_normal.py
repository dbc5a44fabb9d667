"""Prior of an added strength between two values, as a random variable of PyMC."""

from __future__ import annotations

from typing import Any

import numpy as np


def truncated_normal(name: str, scale: Any, low: Any, high: Any) -> Any:
    """Normal variable around 0 between two values, as PyTensor's numba backend can draw it.

    Half-normal where the lower one is 0: with the support's part that is left out, its density is only
    higher by a factor.
    """
    import pymc as pm
    import pytensor.tensor as pt
    from pymc.distributions.transforms import Interval

    root = np.sqrt(2.0)

    def drawn(scale: Any, low: Any, high: Any, size: Any) -> Any:
        share = pm.Uniform.dist(0.0, 1.0, size=size)
        first, last = pt.erf(low / scale / root), pt.erf(high / scale / root)
        inside: Any = pt.clip(scale * root * pt.erfinv(first + share * (last - first)), low, high)
        return inside

    def logp(value: Any, scale: Any, low: Any, high: Any) -> Any:
        share = 0.5 * (pt.erf(high / scale / root) - pt.erf(low / scale / root))
        density = -0.5 * (value / scale) ** 2 - pt.log(scale * share) - 0.5 * np.log(2.0 * np.pi)
        return pt.switch((value >= low) & (value <= high), density, -np.inf)

    between = Interval(bounds_fn=lambda *_: (low, high))
    return pm.CustomDist(name, scale, low, high, dist=drawn, logp=logp, default_transform=between)
