"""The average over where a stretch is: refined shapes, against draws of place and length.

The comparison looks at stretches of three lengths that overlap, parts those that hold much evidence, and
interpolates between them. Here places and lengths are drawn from their prior by adaptive importance sampling,
and the evidence of each draw is computed as that of a refined shape is. Evidence at a shape has its own
reference (`benchmarks.reference`).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import multivariate_t, qmc

from benchmarks.reference.engine import fitted_base
from benchmarks.reference.pairs import Drawn
from skred.diagnosis.compare.over_places import Area
from skred.diagnosis.compare.refinement import refine
from skred.diagnosis.compare.screening import whole_curve
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_near
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import BoundTo, Mechanism
from skred.physics.mechanisms.stretches import is_opposed

FloatArray = NDArray[np.float64]
_FIRST, _EACH, _TURNS, _LAST = 128, 32, 5, 160
"""Draws from the prior, in each turn after, and those that count: no proposal has followed these."""
_DEFENSIVE = 0.2
"""Share of the prior in each later proposal."""
_CENTRES, _NEIGHBOURS, _DEGREES = 12, 6, 5
_EFFECTIVE = 12.0
"""Draws that proposals are put around count for at least so many: by a power of their weights."""


def look(drawn: Drawn) -> dict[str, Any] | None:
    """Log Bayes factor of the leading mechanism of a stretch by both ways; None where there is none."""
    base = fitted_base(hierarchical_problem(drawn.campaign), load_law(drawn.base))
    curves = [
        whole_curve(base, one)
        for one in placed_mechanisms(base.setting)
        if one.added.bound_to is BoundTo.PLACE and not one.shape.constants and not is_opposed(one.shape)
    ]
    if not curves:
        return None
    name = max(curves, key=lambda one: one.log_bayes_factor).mechanism.id
    own = [one for one in curves if one.mechanism.id == name]
    refined, n_refined = by_refinement(base, own)
    found, error, effective, n_drawn = by_draws(base, own, drawn.rng)
    return {
        "mechanism": name,
        "refined": refined,
        "curves": n_refined,
        "drawn": found,
        "standard_error": error,
        "effective": effective,
        "draws": n_drawn,
    }


def by_refinement(base: Base, own: list[Curve]) -> tuple[float, int]:
    """As a comparison has it, and of how many shapes."""
    with ThreadPoolExecutor(1) as pool:
        candidate = refine(base.setting, own, partial(curve_near, base), pool)[own[0].mechanism.id]
    return candidate.alone, len(candidate.curves)


def by_draws(base: Base, own: list[Curve], rng: np.random.Generator) -> tuple[float, float, float, int]:
    """By draws of place and length: with standard error, effective number of draws, and their number."""
    mechanism, area = own[0].mechanism, Area.around([one.shape for one in own], base.setting)
    points = qmc.Sobol(2, seed=rng).random(_FIRST)
    log_factors = heights(base, mechanism, points, area)
    proposals: list[Any] = []
    for _ in range(_TURNS):
        log_weights = log_factors - _log_density(points, proposals)
        proposals.append(_mixture(points, log_weights, _CENTRES, rng))
        new = _from(proposals[-1], _EACH, rng)
        points = np.vstack([points, new])
        log_factors = np.append(log_factors, heights(base, mechanism, new, area))
    last = _mixture(points, log_factors - _log_density(points, proposals), _LAST, rng)
    new = _from(last, _LAST, rng)
    log_weights = heights(base, mechanism, new, area) - np.log(_density(new, last))
    most = float(log_weights.max())
    weights = np.exp(log_weights - most)
    error = float(weights.std() / weights.mean() / math.sqrt(len(weights)))
    effective = float(weights.sum() ** 2 / (weights**2).sum())
    return most + math.log(float(weights.mean())), error, effective, len(points) + len(new)


def heights(base: Base, mechanism: Mechanism, points: FloatArray, area: Area) -> FloatArray:
    """Log Bayes factors at places and lengths in the unit square."""
    every = [placed(mechanism, base.setting, shape) for shape in map(area.shape, points)]
    return np.array([whole_curve(base, one).log_bayes_factor for one in every])


def _mixture(points: FloatArray, log_weights: FloatArray, size: int, rng: np.random.Generator) -> list[Any]:
    """Student t around draws with much weight, as wide as the next draws are apart."""
    weights = _normalised(_temper(log_weights) * log_weights)
    found = []
    for centre in points[rng.choice(len(points), size=size, p=weights)]:
        square = np.sum((points - centre) ** 2, axis=1)
        near = points[np.argsort(square)[: _NEIGHBOURS + 1]] - centre
        covariance = near.T @ near / _NEIGHBOURS + 1e-7 * np.eye(2)
        found.append(multivariate_t(loc=centre, shape=0.5 * covariance, df=_DEGREES, seed=rng))
    return found


def _temper(log_weights: FloatArray) -> float:
    """The largest power, at most one, of weights that leaves enough effective draws."""

    def effective(power: float) -> float:
        return float(1.0 / np.sum(_normalised(power * log_weights) ** 2))

    if effective(1.0) >= _EFFECTIVE:
        return 1.0
    return float(brentq(lambda power: effective(power) - _EFFECTIVE, 0.0, 1.0))


def _from(mixture: list[Any], size: int, rng: np.random.Generator) -> FloatArray:
    """Draws inside the unit square, some of them from the prior."""
    found = list(rng.random((int(rng.binomial(size, _DEFENSIVE)), 2)))
    while len(found) < size:
        one = np.asarray(mixture[int(rng.integers(len(mixture)))].rvs())
        if ((one >= 0.0) & (one < 1.0)).all():
            found.append(one)
    return np.array(found)


def _log_density(points: FloatArray, proposals: list[list[Any]]) -> FloatArray:
    """Of all proposals together, each normalised inside the unit square; the prior's density is 1."""
    total = np.full(len(points), float(_FIRST))
    for mixture in proposals:
        total += _EACH * _density(points, mixture)
    return np.asarray(np.log(total / (_FIRST + _EACH * len(proposals))))


def _density(points: FloatArray, mixture: list[Any]) -> FloatArray:
    """Of a mixture within the unit square, with its share of the prior."""
    inside = np.mean([_inside(one) for one in mixture])
    density = np.mean([np.atleast_1d(one.pdf(points)) for one in mixture], axis=0) / inside
    return np.asarray(_DEFENSIVE + (1.0 - _DEFENSIVE) * density)


def _inside(one: Any) -> float:
    """Share of a Student t within the unit square."""
    return float(one.cdf(np.ones(2), lower_limit=np.zeros(2)))


def _normalised(log_weights: FloatArray) -> FloatArray:
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())
