"""skred's JointMetropolis with its defaults: the sampler under test."""

from __future__ import annotations

from benchmarks.peers import pymc_run
from benchmarks.peers.common import Drawn
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.pooled.problem import PooledProblem


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int) -> Drawn:
    """Four chains; a draw is several moves, as the class sets it."""
    return pymc_run.run(problem, seed, JointMetropolis, draws=draws, tune=tune)
