"""Nutpie's NUTS on the same PyMC model, gradients through the Op's numba dispatch."""

from __future__ import annotations

from typing import Any

import nutpie

from benchmarks.peers.common import Drawn, cpu_seconds, draws_of, near_the_mode
from models.pcm import LAW
from skred.inference.pooled.problem import PooledProblem

CHAINS = 4


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int, start: str) -> Drawn:
    """Four chains on one core with nutpie's defaults, or all started near the mode."""
    point = near_the_mode(problem) if start == "mode" else None
    started = cpu_seconds()
    model = LAW.build(problem)
    # An empty set of jittered variables: a jittered start may lie beyond the cliff.
    compiled = nutpie.compile_pymc_model(model, initial_points=point, jitter_rvs=set() if point else None)
    # A few draws first: whatever is still compiled at the first call is no sampling.
    _run(compiled, seed, 5, 5)
    ready = cpu_seconds()
    tree = _run(compiled, seed, draws, tune)
    return Drawn(draws_of(tree), cpu_seconds() - ready, ready - started)


def _run(compiled: Any, seed: int, draws: int, tune: int) -> Any:
    return nutpie.sample(
        compiled,
        draws=draws,
        tune=tune,
        chains=CHAINS,
        cores=1,
        seed=seed,
        save_warmup=False,
        progress_bar=False,
    )
