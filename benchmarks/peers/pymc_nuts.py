"""PyMC's own NUTS, with gradients through the Op's tangent-linear jacobian."""

from __future__ import annotations

from typing import Any

from benchmarks.peers import pymc_run
from benchmarks.peers.common import Drawn, near_the_mode
from skred.inference.pooled.problem import PooledProblem


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int, start: str) -> Drawn:
    """Four chains with PyMC's defaults (jitter+adapt_diag, target acceptance 0.8).

    With the start "mode", all chains start there instead, without jitter, which would throw them
    off again.
    """
    options: dict[str, Any] = {}
    if start == "mode":
        options = {"initvals": near_the_mode(problem), "init": "adapt_diag"}
    # Named, because PyMC prefers nutpie where it is installed; that is a peer of its own.
    return pymc_run.run(problem, seed, lambda: None, draws=draws, tune=tune, nuts_sampler="pymc", **options)
