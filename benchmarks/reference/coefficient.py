"""The integral over the coefficient of what is added, on a grid that refines itself; and the Bayes factor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.stats import norm

from benchmarks.reference.lattice import Cloud, Resolved, narrow_precision, population_envelope, resolve
from benchmarks.reference.population_integral import PopulationIntegral, integrate_population, nested_evidence
from benchmarks.reference.search import Recorded, search, wide_envelope
from skred.diagnosis.evidence.extension import Extension, extended
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.law import Law
from skred.physics.mechanisms.spec import Direction

FloatArray = NDArray[np.float64]
GRID = (0.004, 0.012, 0.035, 0.09, 0.2, 0.4, 0.75, 1.25, 2.0, 3.2, 5.0, 8.0, 13.0)
"""Coefficients at first, in scales of the mechanism."""
SCALES = np.array([1.0, 3.0, 9.0]) / 3.0
"""Those of the prior, in scales of the mechanism: one of these, each as probable."""
_COUNTS, _HOPELESS = 7.0, 25.0
"""Nats below the best at which the grid is not refined, and at which nothing is computed finely."""
_APART = 1.3
"""Largest difference between neighbours that count [nats]."""
_MOST = 46
_BETWEEN = 40
_ROUGH_LATTICE = 1.3, 9.0
"""Step and depth of the lattices that are laid while no population is known."""
_STEPS = {1: 0.2, 2: 0.6, 3: 0.8, 4: 0.9}
"""Steps of the lattices by their number of axes: on a line points cost nothing, and stops make kinks."""
_ROUGH_DRAWS, _DRAWS = 300.0, 1500.0
"""Effective draws of the population before, and at last."""


@dataclass(frozen=True, eq=False)
class At:
    """Log evidence at one coefficient."""

    found: PopulationIntegral
    resolved: Resolved
    fine: bool


@dataclass(eq=False)
class Reference:
    """Log evidence of a law on a campaign, with something added at any coefficient; computed when asked for.

    Attributes
    ----------
    problem : HierarchicalProblem
    law : Law
    direction : Direction or None
    seed : int
    finer : float
        Factor on the steps of the lattices.
    """

    problem: HierarchicalProblem
    law: Law
    direction: Direction | None
    seed: int
    finer: float = 1.0
    known: dict[float, At] = field(default_factory=dict)

    @property
    def log_scale(self) -> FloatArray:
        """Logarithm of the scales of the medians' priors."""
        return np.log([mechanism.strength.prior_scale for mechanism in self.law.mechanisms])

    def recorded(self, coefficient: float) -> Recorded:
        """The law and the recordings."""
        if self.direction is None:
            return Recorded(extended(self.problem, self.law), np.empty(0))
        extension: Extension = extended(self.problem, self.law, (self.direction,))
        return Recorded(extension, np.array([coefficient]))

    def at(self, coefficient: float, hopeless_below: float = -math.inf) -> At:
        """At one coefficient; not finely if that is hopeless."""
        if coefficient not in self.known or (
            not self.known[coefficient].fine and self.known[coefficient].found.log_evidence > hopeless_below
        ):
            self.known[coefficient] = self._computed(coefficient, hopeless_below)
        return self.known[coefficient]

    def _computed(self, coefficient: float, hopeless_below: float) -> At:
        rng = self._rng(coefficient)
        recorded, log_scale, n = self.recorded(coefficient), self.log_scale, len(self.law.mechanisms)
        envelope = wide_envelope(log_scale)
        points, likelihoods = search(recorded, log_scale, envelope, rng)
        clouds = [Cloud(own, height) for own, height in zip(points, likelihoods, strict=True)]
        resolved = resolve(recorded, clouds, envelope, narrow_precision(None, n), rng, *_ROUGH_LATTICE)
        found = integrate_population(resolved.nodes, log_scale, rng, wanted=_ROUGH_DRAWS)
        if found.log_evidence < hopeless_below:
            return At(found, resolved, False)
        step = self.finer * _STEPS[n + int(recorded.loose.any())]
        for wanted in (_ROUGH_DRAWS, _DRAWS):
            # Twice: the first lattice was laid for any population, the second may have moved it.
            envelope, narrow = population_envelope(found.draws, n), narrow_precision(found.draws, n)
            resolved = resolve(recorded, resolved.clouds, envelope, narrow, rng, step)
            found = integrate_population(resolved.nodes, log_scale, rng, found.draws, wanted)
        return At(found, resolved, True)

    def _rng(self, coefficient: float) -> np.random.Generator:
        """Random numbers of their own for each coefficient: errors that are left do not add up."""
        bits = int(np.float64(coefficient).view(np.uint64))
        return np.random.default_rng([self.seed, bits >> 32, bits & 0xFFFFFFFF])

    def nested(self, coefficient: float, n_live: int) -> tuple[float, float]:
        """Log evidence at one coefficient by nested sampling on the same nodes, and its error."""
        return nested_evidence(self.at(coefficient).resolved.nodes, self.log_scale, self.seed, n_live)


class Curve(NamedTuple):
    """Log evidence along the coefficient, relative to none.

    Attributes
    ----------
    coefficients, log_evidence, errors : (n,) arrays
    log_bayes_factor : float
    """

    coefficients: FloatArray
    log_evidence: FloatArray
    errors: FloatArray
    log_bayes_factor: float


def curve(added: Reference, nothing: At, scale: float, either_sign: bool) -> Curve:
    """Evidence along the coefficient, refined where it counts.

    Parameters
    ----------
    added : Reference
    nothing : At
        Without anything added.
    scale : float
        Of the mechanism, in the coefficient's unit.
    either_sign : bool
    """
    grid = scale * np.array(GRID)
    every = np.concatenate([-grid, grid]) if either_sign else grid
    zero = nothing.found.log_evidence
    best = zero + _log_prior(0.0, scale, either_sign)
    height = {0.0: best}
    order = list(np.argsort(np.abs(every)))
    todo = [float(every[k]) for k in order]
    while todo:
        for one in todo:
            # What its prior density adds is in the limit too.
            prior = _log_prior(one, scale, either_sign)
            at = added.at(one, best - _HOPELESS - prior)
            height[one] = at.found.log_evidence + prior
            best = max(best, height[one])
        todo = _wanted(height) if len(height) < _MOST else []
    coefficients = np.array(sorted(height))
    log_f = np.array([height[float(one)] for one in coefficients]) - zero
    errors = np.array(
        [(nothing if one == 0.0 else added.known[float(one)]).found.error for one in coefficients]
    )
    log_prior = np.array([_log_prior(float(one), scale, either_sign) for one in coefficients])
    return Curve(coefficients, log_f - log_prior, errors, _integrated(coefficients, log_f))


def _log_prior(coefficient: float, scale: float, either_sign: bool) -> float:
    density = float(norm.pdf(coefficient, scale=SCALES * scale).mean())
    # Far out numbers end before logarithms do.
    return math.log(max(density if either_sign else 2.0 * density, 1e-300))


def _wanted(height: dict[float, float]) -> list[float]:
    """Coefficients between those known that the integral hangs on."""
    x = np.array(sorted(height))
    f = np.array([height[float(one)] for one in x])
    top = int(np.argmax(f))
    found = set[float]()
    for k in range(len(x) - 1):
        counts = max(f[k], f[k + 1]) > f[top] - _COUNTS
        if counts and abs(f[k + 1] - f[k]) > _APART and x[k + 1] - x[k] > 1e-3 * abs(x[top]):
            found.add(float(0.5 * (x[k] + x[k + 1])))
    if 0 < top < len(x) - 1:
        # The top of a parabola through the highest three: quicker than halves where it is narrow.
        left, middle, right = x[top - 1 : top + 2]
        slopes = np.diff(f[top - 1 : top + 2]) / np.diff(x[top - 1 : top + 2])
        curvature = (slopes[1] - slopes[0]) / (0.5 * (right - left))
        vertex = 0.5 * (left + middle) - slopes[0] / curvature if curvature < 0.0 else middle
        width = 1.0 / math.sqrt(-curvature) if curvature < 0.0 else 0.0
        if found and left < vertex < right and np.abs(x - vertex).min() > 0.3 * width:
            found = {one for one in found if abs(one - vertex) > 0.5 * width} | {float(vertex)}
    return sorted(found)


def _integrated(coefficients: FloatArray, log_f: FloatArray) -> float:
    most = float(log_f.max())
    shape = PchipInterpolator(coefficients, np.maximum(log_f, most - 60.0))
    parts = np.linspace(coefficients[:-1], coefficients[1:], _BETWEEN, endpoint=False, axis=1)
    fine = np.append(parts.ravel(), coefficients[-1])
    return most + math.log(float(np.trapezoid(np.exp(shape(fine) - most), fine)))
