"""Adaptive importance sampling from Student t densities, whose heavy tails bound the weights.

All draws are weighted by the mixture of all that was proposed (adaptive multiple importance sampling: Cornuet
and others, 2012, doi 10.1111/j.1467-9469.2011.00756.x).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

FloatArray = NDArray[np.float64]
ENOUGH = 0.1
"""Standard error of a log integral, in nats, at which there are enough draws."""
_TURNS = 6
"""Turns of sampling at most, which bounds the time."""
_DEGREES = 5.0
"""Degrees of freedom of the proposals: tails heavy enough to bound the weights."""
_WIDER = 1.2
"""How much wider than what is known of a density its proposal is."""
_SHRUNK = 3.0
"""As how many effective draws a proposal counts, for each axis, beside those that adapt it."""


class Proposal(NamedTuple):
    """Where a density is.

    Attributes
    ----------
    centre : (size,) array
    covariance : (size, size) array
    """

    centre: FloatArray
    covariance: FloatArray

    @property
    def factor(self) -> FloatArray:
        """Lower triangular: the scale of the draws."""
        regular = self.covariance + 1e-9 * np.eye(len(self.centre))
        result: FloatArray = _WIDER * np.linalg.cholesky(regular)
        return result

    def drawn(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draws, (n, size)."""
        white = rng.standard_normal((n, len(self.centre)))
        white *= np.sqrt(_DEGREES / rng.chisquare(_DEGREES, n))[:, None]
        return self.centre + white @ self.factor.T

    def log_density(self, draws: FloatArray) -> FloatArray:
        """At draws, (n, size) to (n,)."""
        size, factor = len(self.centre), self.factor
        squares = np.sum(np.linalg.solve(factor, (draws - self.centre).T) ** 2, axis=0)
        constant = float(gammaln(0.5 * (_DEGREES + size)) - gammaln(0.5 * _DEGREES))
        constant -= 0.5 * size * math.log(_DEGREES * math.pi) + float(np.log(np.diag(factor)).sum())
        result: FloatArray = constant - 0.5 * (_DEGREES + size) * np.log1p(squares / _DEGREES)
        return result


class Weighted(NamedTuple):
    """Draws of proposals.

    Attributes
    ----------
    draws : (n, size) array
    log_weights : (n,) array
        Log of the density over the proposals'.
    proposal : Proposal
        The last one.
    """

    draws: FloatArray
    log_weights: FloatArray
    proposal: Proposal

    @property
    def shares(self) -> FloatArray:
        """The weights, which sum to 1."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        result: FloatArray = weights / weights.sum()
        return result

    @property
    def log_integral(self) -> float:
        """Logarithm of the density's integral."""
        return float(np.logaddexp.reduce(self.log_weights)) - math.log(len(self.log_weights))

    @property
    def error(self) -> float:
        """Standard error of the log integral, in nats."""
        n = len(self.log_weights)
        return float(n * self.shares.std() / math.sqrt(n))

    @property
    def adapted(self) -> Proposal:
        """The last proposal, moved to where the weight is, as far as so many draws can tell.

        Population Monte Carlo: Cappé and others, 2008, doi 10.1007/s11222-008-9059-x.
        """
        weights, before = self.shares, self.proposal
        mean = weights @ self.draws
        deviation = self.draws - mean
        covariance = deviation.T @ (weights[:, None] * deviation)
        effective = 1.0 / float(np.sum(weights**2))
        share = effective / (effective + _SHRUNK * len(mean))
        return Proposal(
            share * mean + (1.0 - share) * before.centre,
            share * covariance + (1.0 - share) * before.covariance,
        )

    def resampled(self, n: int, rng: np.random.Generator) -> FloatArray:
        """So many of the draws, by their weights."""
        return self.draws[rng.choice(len(self.draws), size=n, p=self.shares)]


def weighted_draws(
    log_density: Callable[[FloatArray], FloatArray],
    proposal: Proposal,
    n: int,
    rng: np.random.Generator,
    enough: float = ENOUGH,
) -> Weighted:
    """Draws of a density, in turns until its integral is known well enough.

    Parameters
    ----------
    log_density : callable
        What is integrated: (n, size) to (n,); need not be normalised.
    proposal : Proposal
        Where the density is, roughly.
    n : int
        Draws of a turn.
    enough : float
        Standard error of the log integral, in nats, from which on there are no further turns.

    Raises
    ------
    numpy.linalg.LinAlgError
        If no draw has any density.
    """
    proposals, draws, heights = [proposal], np.empty((0, len(proposal.centre))), np.empty(0)
    while True:
        drawn = proposals[-1].drawn(n, rng)
        draws = np.concatenate([draws, drawn])
        heights = np.append(heights, np.nan_to_num(log_density(drawn), nan=-np.inf))
        if heights.max() == -np.inf:
            raise np.linalg.LinAlgError("nothing is found where a density was thought to be")
        of_each = [one.log_density(draws) for one in proposals]
        log_mixture = np.logaddexp.reduce(of_each, axis=0) - math.log(len(proposals))
        found = Weighted(draws, heights - log_mixture, proposals[-1])
        if found.error < enough or len(proposals) == _TURNS:
            return found
        proposals.append(found.adapted)
