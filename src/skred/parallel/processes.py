"""Helper processes beside this one, for work that is as much Python as compiled code.

Threads of such work wait for each other's Python; processes do not. They start while something else is done
that only one core is needed for, and are there only within `helpers`: a command asks for them, and code that
is called from elsewhere never starts a process by itself. Where one was killed, perhaps for its memory, its
work is done here.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from skred.parallel.threads import threads

_MOST = 3
"""Helpers at most: each holds all the packages in memory."""
_seat = threading.local()
_there: list[Executor] = []


@contextmanager
def helpers(*modules: str) -> Iterator[None]:
    """Have a helper for each further core, if there is one, until the end of the context.

    Parameters
    ----------
    modules : str
        Names of what the helpers are to import as they start.
    """
    n = _wanted()
    if n < 1 or _there:
        yield
        return
    from loky import ProcessPoolExecutor  # it does not run the caller's own script again, as others do

    executor = ProcessPoolExecutor(n, env={"OMP_NUM_THREADS": "1"})
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
    """Let a helper do something while this process goes on.

    Returns
    -------
    callable
        Waits for what comes of it; without helpers it is done then, here.
    """
    begun = _begun(work, *given)

    def result() -> Result:
        try:
            return begun.result() if begun is not None else work(*given)
        except BrokenProcessPool:
            return work(*given)

    return result


def _begun[Result](work: Callable[..., Result], *given: Any) -> Future[Result] | None:
    """What a helper has been asked for; None where there is none, or it was killed before."""
    try:
        return _there[0].submit(work, *given) if _there else None
    except BrokenProcessPool:
        return None


def worker_pool() -> ThreadPoolExecutor:
    """A pool for jobs that know nothing of each other, to be used in a ``with`` statement.

    One of its threads works in this process, and each other one lets a helper work: jobs and results are
    copied then, and what a job changes elsewhere is lost. Threads alone without helpers.
    """
    if not _there:
        return ThreadPoolExecutor(threads())
    seats = itertools.count()

    def take() -> None:
        _seat.number = next(seats)

    return _Crew(1 + _wanted(), initializer=take)


class _Crew(ThreadPoolExecutor):
    def submit[Result](self, work: Callable[..., Result], /, *given: Any) -> Future[Result]:  # type: ignore[override]
        return super().submit(_here_or_there, work, *given)


def _here_or_there[Result](work: Callable[..., Result], *given: Any) -> Result:
    return work(*given) if _seat.number == 0 else meanwhile(work, *given)()
