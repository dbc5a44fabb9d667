"""What every peer returns, and how CPU time is taken."""

from __future__ import annotations

import resource
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.pcm import LAW
from skred.inference.pooled.problem import PooledProblem

FloatArray = NDArray[np.float64]
PARAMETERS = ("dry_friction", "turbulent_drag")


class Drawn(NamedTuple):
    """What a peer's `sample` returns.

    Attributes
    ----------
    draws : (n_chains, n_draws, 2) array
        Dry friction [-] and turbulent drag [1/m], without warm-up.
    cpu_seconds : float
        All of the sampling: warm-up, draws, and making them available.
    compile_seconds : float
        CPU time before: building the model, compiling, finding where to start.
    """

    draws: FloatArray
    cpu_seconds: float
    compile_seconds: float


def cpu_seconds() -> float:
    """CPU time of this process, all its threads, and its finished children."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def near_the_mode(problem: PooledProblem) -> dict[str, float]:
    """Strengths of the highest posterior density (of their logarithms) on a coarse grid.

    The likelihood has kinks where the front just reaches a sensor, a cliff where it does not get
    over a flat stretch, and small modes beside them. Peers that do not find their way from there
    are given this start, free of charge.
    """
    scales = np.array([mechanism.strength.prior_scale for mechanism in LAW.mechanisms])
    axes = [scale * np.geomspace(0.05, 2.0, 40) for scale in scales]
    strengths = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    density = problem.log_density(LAW.mechanisms, strengths).sum(axis=1)
    density += (np.log(strengths) - 0.5 * (strengths / scales) ** 2).sum(axis=1)
    best = strengths[np.argmax(density)]
    return {name: float(strength) for name, strength in zip(PARAMETERS, best, strict=True)}


def draws_of(tree: Any) -> FloatArray:
    """Draws from a DataTree's posterior."""
    return np.stack([tree.posterior[name].values for name in PARAMETERS], axis=-1)
