"""Emcee on the same compiled kernel and density, all walkers of a half-step in one numba call.

It samples log strengths, as PyMC does; its walkers start in a ball around the mode, as its manual
advises (scattered as widely as PyMC's jitter does, some stay for long in small modes). Its two
families of moves are two peers: the default stretch move, and differential evolution with a tenth
of snooker moves (the manual's suggestion is 80:20).
"""

from __future__ import annotations

from typing import Any

import emcee
import numpy as np
from numba import njit

from benchmarks.peers.common import PARAMETERS, Drawn, FloatArray, cpu_seconds, near_the_mode
from models.pcm import LAW
from skred.inference.pooled.density import pooled_log_density
from skred.inference.pooled.problem import PooledProblem
from skred.physics.kernel.fronts import simulate

WALKERS = 128
"""Enough that the compiled code, not emcee's own bookkeeping, takes the time."""
_SCALES = np.array([mechanism.strength.prior_scale for mechanism in LAW.mechanisms])


def _log_densities(strengths, release, path, law, sensors, arrays):  # type: ignore[no-untyped-def]
    """Log density of all events together, (n,)."""
    responses = simulate(strengths, np.full(len(strengths), release), path, law, sensors)
    total = np.empty(len(strengths))
    for i in range(len(strengths)):
        total[i] = pooled_log_density(responses[i : i + 1], arrays).sum()
    return total


class LogProbability:
    """Unnormalised log posterior of many log strengths."""

    def __init__(self, problem: PooledProblem) -> None:
        if len(problem.releases) != 1 or problem.release_speeds.any():
            raise ValueError("this peer knows one release place, from rest")
        law = problem.contributions(LAW.mechanisms)
        # Compiled anew for every run, as the other peers' functions are.
        self._compiled = njit(error_model="numpy")(_log_densities)
        self._inputs = (float(problem.releases[0]), problem.path, law, problem.sensors, problem.arrays)

    def log_density(self, strengths: FloatArray) -> FloatArray:
        """Log likelihood: (n, 2) to (n,)."""
        total: FloatArray = self._compiled(np.ascontiguousarray(strengths), *self._inputs)
        return total

    def __call__(self, log_strengths: FloatArray) -> FloatArray:
        """Log likelihood, half-normal priors and the jacobian of the logarithm: (n, 2) to (n,)."""
        # Beyond this the prior is zero in double precision, and exp must not overflow.
        strengths = np.exp(np.minimum(log_strengths, 50.0))
        prior = (log_strengths - 0.5 * (strengths / _SCALES) ** 2).sum(axis=1)
        return prior + self.log_density(strengths)


def log_density(problem: PooledProblem, strengths: FloatArray) -> FloatArray:
    """Log likelihood as this peer has it: (n, 2) to (n,)."""
    return LogProbability(problem).log_density(strengths)


def sample(problem: PooledProblem, seed: int, *, moves: str, draws: int, tune: int) -> Drawn:
    """One ensemble; every walker counts as a chain."""
    mode = near_the_mode(problem)
    started = cpu_seconds()
    log_probability = LogProbability(problem)
    rng = np.random.default_rng(seed)
    start = np.log([mode[name] for name in PARAMETERS]) + 0.1 * rng.standard_normal((WALKERS, 2))
    log_probability(start)
    ready = cpu_seconds()
    sampler = emcee.EnsembleSampler(WALKERS, 2, log_probability, moves=_moves(moves), vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()  # noqa: NPY002 emcee's generator
    state = sampler.run_mcmc(start, tune, store=False)
    sampler.run_mcmc(state, draws)
    chains = np.exp(sampler.get_chain()).transpose(1, 0, 2)
    return Drawn(chains, cpu_seconds() - ready, ready - started)


def _moves(name: str) -> Any:
    if name == "stretch":
        return None
    return [(emcee.moves.DEMove(), 0.9), (emcee.moves.DESnookerMove(), 0.1)]
