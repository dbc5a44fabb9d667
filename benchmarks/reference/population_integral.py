"""The integral over the population: tempered population Monte Carlo from the prior, and nested sampling.

The first one is quick and its error small; the second, by dynesty, is another route to the same number.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.event_sums import EventNodes, log_likelihoods_of
from benchmarks.reference.mixture import Mixture, around
from benchmarks.reference.population_prior import factors_of, from_cube, log_prior, n_coordinates

FloatArray = NDArray[np.float64]
_FIRST, _EACH = 2000, 1000
"""Draws from the prior, and from each mixture after."""
_LOCAL = 24
_MOST_TURNS = 40
_KEPT = 256
"""Draws of the posterior that are handed on."""


class PopulationIntegral(NamedTuple):
    """Log evidence at one coefficient.

    Attributes
    ----------
    log_evidence, error : float
    draws : (k, n_psi) array
        Of the posterior, equally weighted.
    effective : float
        Effective number of the final draws.
    """

    log_evidence: float
    error: float
    draws: FloatArray
    effective: float


def log_likelihood(psi: FloatArray, nodes: EventNodes, n: int) -> FloatArray:
    """Of populations, (k, n_psi) to (k,)."""
    means = np.ascontiguousarray(psi[:, :n])
    return np.asarray(log_likelihoods_of(means, factors_of(psi, n), *nodes))


def integrate_population(
    nodes: EventNodes,
    log_scale: FloatArray,
    rng: np.random.Generator,
    start: FloatArray | None = None,
    wanted: float = 1500.0,
) -> PopulationIntegral:
    """Integrate over the population.

    Parameters
    ----------
    start : (k, n_psi) array, optional
        Draws of another posterior to begin with; else the prior's. Part of the first ones are the prior's
        in any case.
    wanted : float
        Effective number of the final draws.
    """
    n = len(log_scale)
    psi = from_cube(rng.random((_FIRST, n_coordinates(n))), log_scale)
    log_q = log_prior(psi, log_scale)
    if start is not None:
        near = around(start, np.full(len(start), 1.0 / len(start)), _LOCAL, rng, 1.6)
        psi = np.vstack([psi[:_EACH], near.draw(_EACH, rng)])
        log_q = np.logaddexp(log_prior(psi, log_scale), near.log_density(psi)) - math.log(2.0)
    target, prior = np.empty(0), log_prior(psi, log_scale)
    found = log_likelihood(psi, nodes, n)
    temper = 0.0
    for _ in range(_MOST_TURNS):
        temper = _next_temper(prior - log_q, found, temper)
        weights = _normalised(prior - log_q + temper * found)
        mixture = around(psi, weights, _LOCAL, rng)
        if temper >= 1.0:
            break
        psi, log_q, prior, found = _drawn(mixture, nodes, log_scale, _EACH, rng)
    pooled: list[tuple[FloatArray, ...]] = []
    mixtures: list[Mixture] = []
    effective = 0.0
    for _ in range(12):
        mixtures.append(mixture)
        pooled.append(_drawn(mixture, nodes, log_scale, _EACH, rng))
        psi = np.vstack([part[0] for part in pooled])
        target = np.concatenate([part[2] + part[3] for part in pooled])
        # All draws by the mixture of all that they were drawn from.
        log_q = np.logaddexp.reduce([one.log_density(psi) for one in mixtures]) - math.log(len(mixtures))
        weights = _normalised(target - log_q)
        effective = 1.0 / float(np.sum(weights**2))
        if effective > wanted and len(mixtures) > 1:
            break
        mixture = around(psi, weights, _LOCAL, rng)
    log_w = target - log_q
    most = float(log_w.max())
    w = np.exp(log_w - most)
    error = float(w.std() / w.mean() / math.sqrt(len(w)))
    steps = (np.arange(_KEPT) + rng.random()) / _KEPT
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), steps), len(psi) - 1)
    return PopulationIntegral(most + math.log(float(w.mean())), error, psi[chosen], effective)


def _drawn(
    mixture: Mixture, nodes: EventNodes, log_scale: FloatArray, size: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Draws with their log proposal density, log prior and log likelihood."""
    psi = mixture.draw(size, rng)
    n = len(log_scale)
    # What no prior allows: correlations of one, spreads that overflow.
    psi[:, n : 2 * n] = np.clip(psi[:, n : 2 * n], -12.0, 5.0)
    psi[:, 2 * n :] = np.clip(psi[:, 2 * n :], -8.0, 8.0)
    return psi, mixture.log_density(psi), log_prior(psi, log_scale), log_likelihood(psi, nodes, n)


def _normalised(log_weights: FloatArray) -> FloatArray:
    weights = np.exp(log_weights - log_weights.max())
    return np.asarray(weights / weights.sum())


def _next_temper(log_w: FloatArray, found: FloatArray, temper: float) -> float:
    """The largest power of the likelihood, from one to the next, with enough effective draws."""

    def enough(power: float) -> bool:
        return bool(1.0 / np.sum(_normalised(log_w + power * found) ** 2) > 0.15 * len(found))

    if enough(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if enough(middle) else (low, middle)
    return max(low, min(1.0, temper * 1.05))


def nested_evidence(
    nodes: EventNodes, log_scale: FloatArray, seed: int, n_live: int = 200
) -> tuple[float, float]:
    """Log evidence by nested sampling, and its standard error."""
    import dynesty

    n = len(log_scale)
    sampler = dynesty.NestedSampler(
        lambda psi: float(log_likelihood(psi[None], nodes, n)[0]),
        lambda cube: from_cube(cube, log_scale),
        n_coordinates(n),
        nlive=n_live,
        bound="multi",
        sample="rwalk",
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(dlogz=0.05, print_progress=False)
    return float(sampler.results.logz[-1]), float(sampler.results.logzerr[-1])
