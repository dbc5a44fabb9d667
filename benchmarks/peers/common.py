"""What every peer returns, and how CPU time is taken."""

from __future__ import annotations

import resource
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


def draws_of(tree: Any) -> FloatArray:
    """Draws from a DataTree's posterior."""
    return np.stack([tree.posterior[name].values for name in PARAMETERS], axis=-1)
