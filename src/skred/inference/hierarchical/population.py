"""The population that avalanches' strengths come from, as parameters of a PyMC model.

The logarithms of the strengths are normal across events: the law's own parameters are the medians, and
each strength gets a spread (standard deviation of its logarithm) and each pair a correlation. All
strengths vary: with one left the same for all events, its variability is taken for physics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism

POPULATION = "population"
"""Name of a group of populations, where they are not computed from parameters."""
LKJ_SHAPE = 2.0
"""Of the prior of the correlations (Lewandowski, Kurowicka and Joe): mildly against strong ones."""
_LEAST = 1e-6
"""Least that a partial correlation leaves, so that a factor has an inverse."""


def spread_parameters(mechanisms: Sequence[Mechanism]) -> tuple[Parameter, ...]:
    """Spread of each strength."""
    return tuple(
        Parameter(f"{m.strength.name}_spread", f"sd(log {m.strength.symbol})", "1") for m in mechanisms
    )


def correlation_parameters(mechanisms: Sequence[Mechanism]) -> tuple[Parameter, ...]:
    """Correlation of each pair of strengths; of more than two, partial ones given those before."""
    return tuple(
        Parameter(
            f"{a.strength.name}_{b.strength.name}_correlation",
            f"corr(log {a.strength.symbol}, log {b.strength.symbol})",
            "1",
        )
        for a, b in combinations(mechanisms, 2)
    )


def population_factor(
    spreads: Sequence[Any], correlations: Sequence[Any], sqrt: Any = np.sqrt
) -> list[list[Any]]:
    """Rows of the lower Cholesky factor of the covariance, from spreads and partial correlations.

    Row i of the correlation matrix's factor: its partial correlations with the strengths before, each
    times what the earlier ones leave (Lewandowski, Kurowicka and Joe, 2009, doi 10.1016/j.jmva.2009.04.008).
    """
    n = len(spreads)
    partial = dict(zip(combinations(range(n), 2), correlations, strict=True))
    rows = []
    for i in range(n):
        left, row = 1.0, []
        for j in range(i):
            row.append(spreads[i] * partial[j, i] * left)
            left = left * sqrt(1.0 - partial[j, i] ** 2 + _LEAST)
        rows.append([*row, spreads[i] * left, *([0.0] * (n - 1 - i))])
    return rows


def population_of(law: Law, samples: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """Means and factors of many parameter vectors.

    Parameters
    ----------
    law : Law
    samples : mapping
        Arrays by name of parameter, n values each.

    Returns
    -------
    means : (n, n_strengths) array
        Of the logarithms of the strengths.
    factors : (n, n_strengths, n_strengths) array
        Lower Cholesky factors of their covariance.
    """
    means = np.log(law.strength_rows(samples))
    spreads = [np.ravel(samples[p.name]) for p in spread_parameters(law.mechanisms)]
    correlations = [np.ravel(samples[p.name]) for p in correlation_parameters(law.mechanisms)]
    rows = population_factor(spreads, correlations)
    factors = np.empty((len(means), len(spreads), len(spreads)))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            factors[:, i, j] = value
    return means, factors


def population_group(law: Law, means: FloatArray, factors: FloatArray) -> xr.Dataset:
    """Populations as a dataset that netCDF can hold: ``mean`` and ``factor`` of the logarithms, by draw."""
    names = [mechanism.strength.name for mechanism in law.mechanisms]
    return xr.Dataset(
        {
            "mean": (("draw", "strength"), means),
            "factor": (("draw", "strength", "strength_bis"), factors),
        },
        coords={"strength": names, "strength_bis": names},
    )


def population_samples(law: Law, coordinates: FloatArray) -> dict[str, FloatArray]:
    """Spreads and correlations by name from logarithms and inverse hyperbolic tangents, (n, n_population)."""
    spreads, correlations = spread_parameters(law.mechanisms), correlation_parameters(law.mechanisms)
    values = np.column_stack(
        [np.exp(coordinates[:, : len(spreads)]), np.tanh(coordinates[:, len(spreads) :])]
    )
    return {p.name: values[:, k] for k, p in enumerate((*spreads, *correlations))}


def population_variables(mechanisms: Sequence[Mechanism]) -> Any:
    """Spreads and correlations as random variables of the current PyMC model; the factor, symbolic."""
    import pymc as pm
    import pytensor.tensor as pt

    spreads = [
        pm.LogNormal(p.name, mu=math.log(SPREAD_MEDIAN), sigma=SPREAD_LOG_SD)
        for p in spread_parameters(mechanisms)
    ]
    n = len(mechanisms)
    correlations = [
        _lkj_partial(p.name, LKJ_SHAPE + 0.5 * (n - 2 - given))
        for p, (given, _) in zip(correlation_parameters(mechanisms), combinations(range(n), 2), strict=True)
    ]
    rows = population_factor(spreads, correlations, pt.sqrt)
    return pt.stack([pt.stack([pt.as_tensor_variable(value) for value in row]) for row in rows])


def _lkj_partial(name: str, shape: float) -> Any:
    """Partial correlation whose (1 + r) / 2 is Beta(shape, shape)."""
    import pymc as pm
    from pymc.distributions.transforms import Interval

    def scaled_beta(size: Any) -> Any:
        return 2.0 * pm.Beta.dist(shape, shape, size=size) - 1.0

    return pm.CustomDist(name, dist=scaled_beta, default_transform=Interval(-1.0, 1.0))
