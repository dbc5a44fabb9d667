"""`pymc.sample` with its CPU time split into compilation and sampling."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import pymc as pm

from benchmarks.peers.common import Drawn, cpu_seconds, draws_of
from models.pcm import LAW
from skred.inference.pooled.problem import PooledProblem

CHAINS = 4


class _FirstDraw:
    """Callback that notes when the first draw is done: all is compiled by then."""

    def __init__(self) -> None:
        self.at = float("nan")
        self._seen = False

    def __call__(self, trace: Any, draw: Any) -> None:
        if not self._seen:
            self._seen = True
            self.at = cpu_seconds()


def run(
    problem: PooledProblem,
    seed: int,
    make_step: Callable[[], Any],
    *,
    draws: int,
    tune: int,
    **options: Any,
) -> Drawn:
    """Four chains, one after the other in this process.

    Parameters
    ----------
    make_step : callable
        Makes the step method inside the model; None for PyMC's choice.
    draws, tune : int
        Of each chain.
    **options
        For `pymc.sample`.
    """
    logging.getLogger("pymc").setLevel(logging.ERROR)
    first_draw = _FirstDraw()
    started = cpu_seconds()
    with LAW.build(problem):
        tree = pm.sample(
            draws,
            tune=tune,
            step=make_step(),
            chains=CHAINS,
            cores=1,
            random_seed=seed,
            callback=first_draw,
            progressbar=False,
            compute_convergence_checks=False,
            **options,
        )
    ended = cpu_seconds()
    return Drawn(draws_of(tree), ended - first_draw.at, first_draw.at - started)
