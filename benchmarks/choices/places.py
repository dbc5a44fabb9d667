"""The average over where a stretch is: refined shapes, against draws of place and length.

The comparison looks at stretches of three lengths that overlap, and parts those that hold much evidence.
Here the prior is continuous: the end uniform over the recorded part, the logarithm of the length uniform over
what these lengths stand for. Both are drawn by adaptive importance sampling, and the evidence of each draw is
computed as that of a refined shape is. Evidence at a shape has its own reference (`benchmarks.reference`).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_t, qmc

from benchmarks.reference.engine import fitted_base
from benchmarks.reference.pairs import Drawn
from skred.diagnosis.compare.refinement import refine
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base, curve_near
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms.placed import PlacedMechanism, placed
from skred.physics.mechanisms.spec import BoundTo, Mechanism, Shape
from skred.physics.mechanisms.stretches import STRETCHES_M, is_opposed

FloatArray = NDArray[np.float64]
_FIRST, _EACH, _TURNS = 128, 48, 4
"""Draws from the prior, and in each turn after."""
_DEFENSIVE = 0.2
"""Share of the prior in each later proposal."""
_CENTRES, _DEGREES = 12, 5


def look(drawn: Drawn) -> dict[str, Any] | None:
    """Log Bayes factor of a mechanism of a stretch by both ways; None where the law or the track has none."""
    base = fitted_base(hierarchical_problem(drawn.campaign), load_law(drawn.base))
    own: dict[str, list[PlacedMechanism]] = {}
    for one in placed_mechanisms(base.setting):
        if one.added.bound_to is BoundTo.PLACE and not one.shape.constants and not is_opposed(one.shape):
            own.setdefault(one.mechanism.id, []).append(one)
    if not own:
        return None
    hidden = [one["id"] for one in drawn.hidden if one["id"] in own]
    name = hidden[0] if hidden else str(drawn.rng.choice(sorted(own)))
    refined, n_refined = _refined(base, own[name])
    found, error, effective, n_drawn = _drawn(base, own[name], drawn.rng)
    return {
        "mechanism": name,
        "refined": refined,
        "curves": n_refined,
        "drawn": found,
        "error": error,
        "effective": effective,
        "draws": n_drawn,
    }


def _refined(base: Base, own: list[PlacedMechanism]) -> tuple[float, int]:
    """As a comparison has it, and of how many shapes."""
    with ThreadPoolExecutor(1) as pool:
        curves = [curve(base, one) for one in own]
        candidate = refine(base.setting, curves, partial(curve_near, base), pool)[own[0].mechanism.id]
    return candidate.alone, len(candidate.curves)


def _drawn(
    base: Base, own: list[PlacedMechanism], rng: np.random.Generator
) -> tuple[float, float, float, int]:
    """By draws of place and length: with standard error, effective number of draws, and their number."""
    mechanism, lengths = own[0].mechanism, sorted({_length(one.shape) for one in own})
    low, high = _range(lengths)
    points = qmc.Sobol(2, seed=rng).random(_FIRST)
    log_factors = _heights(base, mechanism, points, low, high)
    proposals: list[Any] = []
    for _ in range(_TURNS):
        weights = _normalised(log_factors - _log_density(points, proposals))
        proposals.append(_mixture(points, weights, rng))
        new = _from(proposals[-1], rng)
        points = np.vstack([points, new])
        log_factors = np.append(log_factors, _heights(base, mechanism, new, low, high))
    log_weights = log_factors - _log_density(points, proposals)
    most = float(log_weights.max())
    weights = np.exp(log_weights - most)
    error = float(weights.std() / weights.mean() / math.sqrt(len(weights)))
    effective = float(weights.sum() ** 2 / (weights**2).sum())
    return most + math.log(float(weights.mean())), error, effective, len(points)


def _length(shape: Shape) -> float:
    """Of the stretch, before the track's beginning cuts it [m]."""
    assert shape.s_from_m is not None and shape.s_to_m is not None
    length = shape.s_to_m - shape.s_from_m
    return min(STRETCHES_M, key=lambda one: abs(one - length)) if shape.s_from_m > 0.0 else STRETCHES_M[-1]


def _range(lengths: list[float]) -> tuple[float, float]:
    """Logarithms of the lengths that some stand for: half-way to the next, as far beyond the last."""
    logs = np.log(lengths)
    step = np.diff(logs) if len(logs) > 1 else np.array([1.0])
    return float(logs[0] - step[0] / 2.0), float(logs[-1] + step[-1] / 2.0)


def _heights(base: Base, mechanism: Mechanism, points: FloatArray, low: float, high: float) -> FloatArray:
    """Log Bayes factors at places and lengths in the unit square."""
    first, last = base.setting.recorded_m
    found = []
    for across, along in points:
        end, length = last - across * (last - first), math.exp(low + along * (high - low))
        shape = Shape(max(end - length, 0.0), end)
        rough = curve(base, placed(mechanism, base.setting, shape))
        found.append(curve_near(base, rough, shape).log_bayes_factor)
    return np.array(found)


def _mixture(points: FloatArray, weights: FloatArray, rng: np.random.Generator) -> list[Any]:
    """Student t around draws with much weight."""
    mean = weights @ points
    covariance = (points - mean).T @ ((points - mean) * weights[:, None])
    covariance = covariance / len(points) ** (1.0 / 3.0) + 1e-6 * np.eye(2)
    centres = points[rng.choice(len(points), size=_CENTRES, p=weights)]
    return [multivariate_t(loc=centre, shape=covariance, df=_DEGREES, seed=rng) for centre in centres]


def _from(mixture: list[Any], rng: np.random.Generator) -> FloatArray:
    """Draws inside the unit square, some of them from the prior."""
    found = [rng.random(2) for _ in range(round(_DEFENSIVE * _EACH))]
    while len(found) < _EACH:
        one = np.asarray(mixture[int(rng.integers(len(mixture)))].rvs())
        if ((one >= 0.0) & (one < 1.0)).all():
            found.append(one)
    return np.array(found)


def _log_density(points: FloatArray, proposals: list[list[Any]]) -> FloatArray:
    """Of all proposals together, each normalised inside the unit square; the prior's density is 1."""
    total = np.full(len(points), float(_FIRST))
    for mixture in proposals:
        inside = np.mean([_inside(one) for one in mixture])
        density = np.mean([np.atleast_1d(one.pdf(points)) for one in mixture], axis=0) / inside
        total += _EACH * (_DEFENSIVE + (1.0 - _DEFENSIVE) * density)
    return np.log(total / (_FIRST + _EACH * len(proposals)))


def _inside(one: Any) -> float:
    """Share of a Student t within the unit square."""
    return float(one.cdf(np.ones(2), lower_limit=np.zeros(2)))


def _normalised(log_weights: FloatArray) -> FloatArray:
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())
