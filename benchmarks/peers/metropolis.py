"""PyMC's Metropolis as it comes: one scalar at a time, scale tuned to the acceptance."""

from __future__ import annotations

import pymc as pm

from benchmarks.peers import pymc_run
from benchmarks.peers.common import Drawn
from skred.inference.pooled.problem import PooledProblem


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int) -> Drawn:
    """Four chains on the same model, which it evaluates through the same numba Op."""
    return pymc_run.run(problem, seed, pm.Metropolis, draws=draws, tune=tune)
