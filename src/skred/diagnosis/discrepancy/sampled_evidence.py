"""The evidence of a force that is not in the list by importance sampling, beside the Laplace approximation.

Where fronts stop near sensors, a climb ends on what is left of integration errors, near the mode and not at
it, and the density is not as curved there as the readings' tangents say. By the Laplace approximation alone
this force can have four nats less than its due, and a listed mechanism its place.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal, multivariate_t

from skred.diagnosis.discrepancy.fit import mode_at
from skred.diagnosis.discrepancy.profile import KINDS, Mode, Profile, knot_by_knot, priors_of
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.refit import Rounds, refit

FloatArray = NDArray[np.float64]
_FEWEST = 2
"""Turns of sampling in any case: the first proposals are rough, the second are adapted to what they found."""
_MOST = 6
"""Turns of sampling at most, which bounds the time."""
_DRAWS = 64
"""Draws of each turn: two lots of those fitted together, one for each of two cores."""
_ENOUGH = 25.0
"""Effective draws that are enough: right to a fifth of a nat."""
_ODD = 0.1
"""Share of all weight on one draw from which on a mode is looked for there: the proposals have missed one."""
_NEW_SHARE = 0.3
"""Share of the draws on a mode that was found so: its weight is not known yet."""
_AT_ONCE = 32
"""Draws fitted together."""
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


def sampled_log_factor(
    base: Base,
    profile: Profile,
    pool: Executor,
    least: float = -math.inf,
    seed: int = 0,
    turns: int = _MOST,
    enough: float = _ENOUGH,
) -> float:
    """Log Bayes factor of a kind of profile over all its priors, by importance sampling of its values.

    Parameters
    ----------
    pool : Executor
        For the fits, some draws at once. This itself must not be a job of the pool: it waits for those.
    least : float
        Where it is less than this after the first turns, further ones are not worth it.
    turns : int
        Of sampling, at most.
    enough : float
        Effective draws from which on there is none further.
    """
    rng = np.random.default_rng([seed, 61, KINDS.index(profile.kind)])
    proposals, values, heights = [_on_modes(profile)], np.empty((0, len(profile.mean))), np.empty(0)
    while True:
        drawn = proposals[-1].drawn(_DRAWS, rng)
        values = np.concatenate([values, drawn])
        heights = np.append(heights, _heights(base, profile, drawn, pool))
        # All draws are weighed by the mixture of all proposals.
        densities = [np.logaddexp.reduce(one.log_densities(values), axis=0) for one in proposals]
        log_weights = heights - np.logaddexp.reduce(densities, axis=0) + math.log(len(proposals))
        total = float(np.logaddexp.reduce(log_weights))
        if total == -math.inf:  # no draw has fronts that tell anything
            return profile.log_bayes_factor
        factor, weights = _mean(log_weights), np.exp(log_weights - total)
        ended = factor < least or 1.0 / np.sum(weights**2) > enough
        if (ended and len(proposals) >= _FEWEST) or len(proposals) >= turns:
            return factor
        proposal = proposals[-1].adapted(values, weights)
        if weights.max() > _ODD:
            # Where fronts stop there are more modes than climbs find: so do Raftery and Bao, 2010,
            # doi 10.1111/j.1541-0420.2010.01399.x.
            odd = values[np.argmax(weights)]
            proposal = proposal.joined_by(pool.submit(mode_at, base, profile, odd).result())
        proposals.append(proposal)


def _mean(log_weights: FloatArray) -> float:
    """Log of the weights' mean, no weight larger than this times the root of their number.

    A single draw on a spike does not decide then: Ionides, 2008, doi 10.1198/106186008X320456.
    """
    most = float(np.logaddexp.reduce(log_weights)) - 0.5 * math.log(len(log_weights))
    return float(np.logaddexp.reduce(np.minimum(log_weights, most))) - math.log(len(log_weights))


def _on_modes(profile: Profile) -> _Proposal:
    """Where the fit says that values are."""
    evened = _TEMPERED * np.array([mode.log_factor for mode in profile.modes])
    means = np.array([mode.mean for mode in profile.modes])
    covariances = _WIDER**2 * np.array([mode.covariance for mode in profile.modes])
    centred = [multivariate_t(shape=one, df=_DEGREES) for one in covariances]
    return _Proposal(evened - np.logaddexp.reduce(evened), means, covariances, centred)


def _heights(base: Base, profile: Profile, values: FloatArray, pool: Executor) -> FloatArray:
    """Gain in log evidence at values of the profile, (n, n_knots), and their log prior density."""
    parts = [values[first : first + _AT_ONCE] for first in range(0, len(values), _AT_ONCE)]
    found = np.concatenate(list(pool.map(partial(_log_evidence, base, profile), parts)))
    nothing = profile.fit.found.log_evidence - profile.gain
    priors = priors_of(profile.kind, profile.knots_m).items()
    densities = [
        share + multivariate_normal(cov=prior.cover(profile.knots_m)).logpdf(values).reshape(-1)
        for prior, share in priors
    ]
    heights = found - nothing + np.logaddexp.reduce(densities, axis=0)
    return np.where(np.isfinite(heights), heights, -np.inf)


def _log_evidence(base: Base, profile: Profile, values: FloatArray) -> FloatArray:
    """At values of the profile, (n, n_knots)."""
    extension = knot_by_knot(base, profile.kind, profile.knots_m)
    start = profile.fit.found.population(len(base.law.mechanisms)), profile.fit.points
    given = np.column_stack([np.tile(base.strengths, (len(values), 1)), values])
    # With as many nodes and rounds as the peak and nothing: what is left of integration errors is alike.
    fits = refit(extension, base.rows, given, start, Rounds(USUAL, least=1))
    return np.array([fit.found.log_evidence for fit in fits])
