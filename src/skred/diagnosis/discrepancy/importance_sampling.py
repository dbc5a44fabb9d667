"""Integrals over a profile's values by adaptive importance sampling from a mixture around modes.

All draws are weighed by the mixture of all that was proposed. Proposals move to where the weight is, and a
mode is looked for wherever a single draw has much of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_t

from skred.diagnosis.discrepancy.profile import Mode

FloatArray = NDArray[np.float64]
_FEWEST = 2
"""Turns of sampling in any case: the first proposals are rough, the second are adapted to what they found."""
MOST_TURNS = 6
"""Turns of sampling at most, which bounds the time."""
_DRAWS = 64
"""Draws of each turn: two lots of those fitted together, one for each of two cores."""
ENOUGH = 25.0
"""Effective draws that are enough: right to a fifth of a nat."""
_ODD = 0.1
"""Share of all weight on one draw from which on a mode is looked for there: the proposals have missed one."""
_NEW_SHARE = 0.3
"""Share of the draws on a mode that was found so: its weight is not known yet."""
_WIDER = 1.1
"""Width of the proposals in that of the Laplace approximation, which is rather too narrow."""
_DEGREES = 7
"""Degrees of freedom of the proposals: tails heavy enough to bound the weights."""
_TEMPERED = 0.5
"""Tempering exponent of the modes' Bayes factors in how many draws each one has: they are rough."""


class _Proposal(NamedTuple):
    """A mixture of Student distributions, one on each mode.

    Attributes
    ----------
    log_weights : (n_modes,) array
    means : (n_modes, n_knots) array
    covariances : (n_modes, n_knots, n_knots) array
    centred : list of frozen distributions
        Each mode's, around 0.
    """

    log_weights: FloatArray
    means: FloatArray
    covariances: FloatArray
    centred: list[Any]

    def drawn(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Values of the profile, (n, n_knots); of each mode as many as its weight says."""
        steps = (np.arange(n) + rng.random()) / n
        modes = np.searchsorted(np.cumsum(np.exp(self.log_weights)), steps).clip(max=len(self.means) - 1)
        counts = np.bincount(modes, minlength=len(self.means)).tolist()
        return np.concatenate([self._of_mode(k, count, rng) for k, count in enumerate(counts) if count])

    def _of_mode(self, k: int, n: int, rng: np.random.Generator) -> FloatArray:
        # Not by scipy's own draws: singular vectors turn with the last digit, Cholesky's factor does not.
        zero = np.zeros(self.means.shape[1])
        normal = rng.multivariate_normal(zero, self.covariances[k], n, method="cholesky")
        return self.means[k] + normal / np.sqrt(rng.chisquare(_DEGREES, n) / _DEGREES)[:, None]

    def log_densities(self, values: FloatArray) -> FloatArray:
        """Of each mode with its weight, (n_modes, n)."""
        pairs = zip(self.centred, self.means, strict=True)
        found = [one.logpdf(values - mean).reshape(-1) for one, mean in pairs]
        return np.array(found) + self.log_weights[:, None]

    def adapted(self, values: FloatArray, weights: FloatArray) -> _Proposal:
        """With weights and means that weighted values call for.

        Population Monte Carlo: Cappé and others, 2008, doi 10.1007/s11222-008-9059-x.
        """
        log_densities = self.log_densities(values)
        shares = weights * np.exp(log_densities - np.logaddexp.reduce(log_densities, axis=0))
        total = shares.sum(axis=1)
        effective = total**2 / np.maximum(np.sum(shares**2, axis=1), 1e-300)
        # A mean of fewer effective draws than knots would be farther off than the mode's own.
        trust = effective / (self.means.shape[1] + effective)
        found = (shares @ values) / np.maximum(total, 1e-300)[:, None]
        means = self.means + trust[:, None] * (found - self.means)
        return self._replace(log_weights=np.log(0.5 * np.exp(self.log_weights) + 0.5 * total), means=means)

    def joined_by(self, mode: Mode) -> _Proposal:
        """With one mode more, and a share of the draws on it."""
        covariance = _WIDER**2 * mode.covariance
        return _Proposal(
            np.append(self.log_weights + math.log1p(-_NEW_SHARE), math.log(_NEW_SHARE)),
            np.vstack([self.means, mode.mean]),
            np.concatenate([self.covariances, covariance[None]]),
            [*self.centred, multivariate_t(shape=covariance, df=_DEGREES)],
        )


def log_integral(
    log_density: Callable[[FloatArray], FloatArray],
    modes: Sequence[Mode],
    mode_near: Callable[[FloatArray], Mode],
    rng: np.random.Generator,
    least: float = -math.inf,
    turns: int = MOST_TURNS,
    enough: float = ENOUGH,
) -> float:
    """Log of the integral of a density that is not normalised; minus infinity where no draw has any.

    Parameters
    ----------
    log_density : callable
        Of values, (n, n_axes) to (n,).
    modes : sequence of Mode
        Where the density is known to be, and roughly how much of it.
    mode_near : callable
        Takes the values of a draw, (n_axes,), and climbs from there.
    rng : numpy.random.Generator
    least : float
        Where the result is less than this after the first turns, further ones are not worth it.
    turns : int
        Of sampling, at most.
    enough : float
        Effective draws from which on there is none further.
    """
    proposals, values, heights = [_on_modes(modes)], np.empty((0, len(modes[0].mean))), np.empty(0)
    while True:
        drawn = proposals[-1].drawn(_DRAWS, rng)
        values = np.concatenate([values, drawn])
        heights = np.append(heights, log_density(drawn))
        densities = [np.logaddexp.reduce(one.log_densities(values), axis=0) for one in proposals]
        log_weights = heights - np.logaddexp.reduce(densities, axis=0) + math.log(len(proposals))
        total = float(np.logaddexp.reduce(log_weights))
        if total == -math.inf:
            return total
        found, weights = _mean(log_weights), np.exp(log_weights - total)
        ended = found < least or 1.0 / np.sum(weights**2) > enough
        if (ended and len(proposals) >= _FEWEST) or len(proposals) >= turns:
            return found
        proposal = proposals[-1].adapted(values, weights)
        if weights.max() > _ODD:
            # Where fronts stop there are more modes than climbs find: so do Raftery and Bao, 2010,
            # doi 10.1111/j.1541-0420.2010.01399.x.
            proposal = proposal.joined_by(mode_near(values[np.argmax(weights)]))
        proposals.append(proposal)


def _mean(log_weights: FloatArray) -> float:
    """Log of the weights' mean, no weight larger than this times the root of their number.

    A single draw on a spike does not decide then: Ionides, 2008, doi 10.1198/106186008X320456.
    """
    most = float(np.logaddexp.reduce(log_weights)) - 0.5 * math.log(len(log_weights))
    return float(np.logaddexp.reduce(np.minimum(log_weights, most))) - math.log(len(log_weights))


def _on_modes(modes: Sequence[Mode]) -> _Proposal:
    """Around each mode."""
    evened = _TEMPERED * np.array([mode.log_factor for mode in modes])
    means = np.array([mode.mean for mode in modes])
    covariances = _WIDER**2 * np.array([mode.covariance for mode in modes])
    centred = [multivariate_t(shape=one, df=_DEGREES) for one in covariances]
    return _Proposal(evened - np.logaddexp.reduce(evened), means, covariances, centred)
