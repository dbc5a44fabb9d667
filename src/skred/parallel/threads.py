"""Work in threads. Compiled code and linear algebra release the GIL, so that threads run in parallel."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

_inside = threading.local()


def threads() -> int:
    """Number of threads: OMP_NUM_THREADS, which `skred prove` sets for its trials, or else all cores.

    Within a thread of `side_by_side` it is one: threads of threads would wait for each other.
    """
    if getattr(_inside, "one_of_many", False):
        return 1
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return int(allowed) if allowed.isdecimal() and int(allowed) > 0 else os.cpu_count() or 1


def side_by_side[Job, Result](work: Callable[[Job], Result], jobs: Sequence[Job]) -> list[Result]:
    """Results of independent jobs, in their order."""
    if threads() == 1:
        return [work(job) for job in jobs]
    with ThreadPoolExecutor(threads(), initializer=_enter) as pool:
        return list(pool.map(work, jobs))


def _enter() -> None:
    _inside.one_of_many = True


def in_parts(n: int, at_least: int = 1) -> list[slice]:
    """Split 0 to n into parts of similar size, none empty: one for each thread, or more if asked for."""
    ends = np.unique(np.linspace(0, n, max(threads(), at_least) + 1).round().astype(int))
    return [slice(int(first), int(end)) for first, end in pairwise(ends)]
