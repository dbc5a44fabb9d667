"""Worker processes, for work that is as much Python as compiled code.

Threads of such work wait for Python's global lock; processes do not. Workers exist only within `helpers`. A
command asks for them, and starts them while it does something that needs one core only. Library code never
starts a process by itself. If a worker is killed, perhaps for its memory, its work is done in this process.
So is work on something that another thread has just changed while it was copied: what an object has found
once it may remember, and a copy of it then breaks off.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from pickle import PicklingError
from typing import Any

from skred.parallel.threads import threads

_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "LOKY_MAX_MEMORY_LEAK_SIZE": "2e9"}
"""Of workers: one thread each; they keep what they compiled and read, which loky else takes for a leak, and
starts them anew with warnings."""
_MOST = 3
"""Most workers; each holds all packages in memory."""
_FEEDER, _PATIENCE_S = "QueueFeederThread", 5.0
"""Name of the thread that passes work on to workers, and how long it may take to end [s]."""
_seat = threading.local()
_there: list[Executor] = []


@contextmanager
def helpers(*modules: str) -> Iterator[None]:
    """Keep a worker process for each further core until the end of the context.

    Parameters
    ----------
    modules : str
        Names of modules that workers import when they start.
    """
    n = _wanted()
    if n < 1 or _there:
        yield
        return
    try:
        with _started(n, modules):
            yield
    finally:
        # A thread of theirs is not waited for, and holds semaphores. Were one removed just as the interpreter
        # ends, that could not be told of any more, and the user would be warned of a leak.
        for thread in threading.enumerate():
            if thread.name == _FEEDER:
                thread.join(_PATIENCE_S)


@contextmanager
def _started(n: int, modules: tuple[str, ...]) -> Iterator[None]:
    from loky import ProcessPoolExecutor  # it does not run the caller's script again, as others do

    executor = ProcessPoolExecutor(n, env=_ENVIRONMENT)
    _there.append(executor)
    try:
        for _ in range(n):
            executor.submit(_prepare, modules)
        yield
    finally:
        _there.clear()
        executor.shutdown(wait=True, kill_workers=True)


def _wanted() -> int:
    return min(threads() - 1, _MOST)


def _prepare(modules: tuple[str, ...]) -> None:
    for name in modules:
        import_module(name)


def meanwhile[Result](work: Callable[..., Result], *given: Any) -> Callable[[], Result]:
    """Start work in a worker process and go on.

    Returns
    -------
    callable
        Waits for the result. Without workers, or where nothing could be copied to one, the work is done then,
        in this process.
    """
    begun = _begun(work, *given)

    def result() -> Result:
        try:
            return begun.result() if begun is not None else work(*given)
        except (BrokenProcessPool, PicklingError):
            return work(*given)

    return result


def _begun[Result](work: Callable[..., Result], *given: Any) -> Future[Result] | None:
    """Work submitted to a worker; None if there is no worker, or it was killed."""
    try:
        return _there[0].submit(work, *given) if _there else None
    except BrokenProcessPool:
        return None


def worker_pool() -> ThreadPoolExecutor:
    """A pool for independent jobs, to be used in a ``with`` statement.

    One of its threads works in this process. Each other one passes its jobs to a worker process: jobs and
    results are copied, and changes that a job makes to other objects are lost. Without workers there are
    threads only.
    """
    if not _there:
        return ThreadPoolExecutor(threads())
    seats = itertools.count()

    def take() -> None:
        _seat.number = next(seats)

    return _Crew(1 + _wanted(), initializer=take)


def in_processes[Result](work: Callable[..., Result], jobs: Iterable[tuple[Any, ...]]) -> list[Result]:
    """Do work that no two threads may do at once: as `worker_pool` does it, or job by job without workers."""
    if not _there:
        return [work(*job) for job in jobs]
    with worker_pool() as pool:
        return list(pool.map(work, *zip(*jobs, strict=True)))


class _Crew(ThreadPoolExecutor):
    def submit[Result](self, work: Callable[..., Result], /, *given: Any) -> Future[Result]:  # type: ignore[override]
        return super().submit(_here_or_there, work, *given)


def _here_or_there[Result](work: Callable[..., Result], *given: Any) -> Result:
    return work(*given) if _seat.number == 0 else meanwhile(work, *given)()
