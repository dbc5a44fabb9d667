"""One mechanism in the comparison: its evidence, strength and place, over all its shapes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.evidence.coefficient import Curve
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.mechanisms.stretches import is_opposed

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One mechanism in the comparison, under one error model.

    Attributes
    ----------
    mechanism : Mechanism
    curves : tuple of Curve
        One for each shape.
    log_weights : (n_curves,) array
        Prior weight of each shape; they sum to 1.
    correction : float
        What many more nodes, and importance sampling over the population, change at the top of the best
        curve, in nats; 0 where not looked at.
    disagreement : float or None
        Importance sampling less Laplace's formula there, nothing's subtracted; None where not looked at.
    """

    mechanism: Mechanism
    curves: tuple[Curve, ...]
    log_weights: FloatArray
    correction: float = 0.0
    disagreement: float | None = None

    @property
    def log_factors(self) -> FloatArray:
        """Log Bayes factor of each shape, its prior weight included."""
        return self.log_weights + np.array([one.log_bayes_factor for one in self.curves])

    @property
    def log_bayes_factor(self) -> float:
        """Against nothing, shapes and strength integrated over."""
        return float(np.logaddexp.reduce(self.log_factors)) + self.correction

    @property
    def shape_weights(self) -> FloatArray:
        """Posterior probability of each shape."""
        factors = self.log_factors
        weights: FloatArray = np.exp(factors - np.logaddexp.reduce(factors))
        return weights

    @property
    def best(self) -> Curve:
        """The curve of the highest Bayes factor."""
        return self.curves[int(np.argmax([one.log_bayes_factor for one in self.curves]))]

    def strength(self) -> tuple[float, float]:
        """Posterior mean and standard deviation of the strength over all shapes."""
        moments = np.array([one.moments for one in self.curves])
        weights = self.shape_weights
        mean = float(weights @ moments[:, 0])
        return mean, math.sqrt(float(weights @ (moments[:, 1] ** 2 + (moments[:, 0] - mean) ** 2)))

    def strength_between_shapes(self) -> float:
        """What not knowing the place adds to the standard deviation about the best shape's mean.

        Over the shapes whose strengths mean the same: of one sensor, covariate, speed scale, opposed or not.
        """
        best = self.best
        same = [k for k, one in enumerate(self.curves) if _means_the_same(one, best)]
        apart = np.array([self.curves[k].moments[0] - best.moments[0] for k in same])
        weights = self.shape_weights[same]
        return math.sqrt(float(weights @ apart**2 / weights.sum()))

    def stretch(self) -> tuple[float, float] | None:
        """Where it acts: weighted medians of both ends [m], None where it is not local."""
        if self.best.shape.place_m is None:
            return None
        first = np.array([one.shape.s_from_m for one in self.curves], dtype=float)
        last = np.array([one.shape.s_to_m for one in self.curves], dtype=float)
        weights = self.shape_weights
        return _weighted_median(first, weights), _weighted_median(last, weights)


def _means_the_same(one: Curve, other: Curve) -> bool:
    """Whether strengths of two shapes are the same quantity."""

    def meaning(curve: Curve) -> tuple[str | None, str | None, bool, float | None]:
        shape = curve.shape
        return shape.sensor, shape.covariate, is_opposed(shape), curve.direction.weakening_speed

    return meaning(one) == meaning(other)


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][min(int(np.searchsorted(share, 0.5 * share[-1])), len(values) - 1)])
