"""Helper processes: what they do is what would have been done here."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from skred.parallel.processes import helpers, in_processes, meanwhile, worker_pool
from skred.parallel.threads import threads


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2")


def where(number: int, base: list[int]) -> tuple[int, int, int, int]:
    """A job that takes a while: its number, what it makes of it, the process that did it, its threads."""
    time.sleep(0.05)
    return number, number + base[0], os.getpid(), threads()


def test_a_worker_pool_shares_jobs_between_this_process_and_a_helper(two_cores: None) -> None:
    base = [100]
    with helpers("skred.physics.kernel.fronts"), worker_pool() as pool:
        found = list(pool.map(lambda number: where(number, base), range(60)))  # closures go there too
    assert [row[:2] for row in found] == [(number, 100 + number) for number in range(60)]
    processes = {row[2] for row in found}
    assert os.getpid() in processes and len(processes) == 2
    (helper,) = processes - {os.getpid()}
    assert {row[3] for row in found if row[2] == helper} == {1}
    with pytest.raises(ProcessLookupError):  # ended with the context
        os.kill(helper, 0)


def test_without_helpers_all_is_done_here(two_cores: None) -> None:
    with worker_pool() as pool:
        assert {pool.submit(os.getpid).result() for _ in range(4)} == {os.getpid()}
    assert meanwhile(os.getpid)() == os.getpid()


def test_what_no_two_threads_may_do_goes_to_processes_only(two_cores: None) -> None:
    jobs = [(number, [100]) for number in range(20)]
    with helpers("skred.physics.kernel.fronts"):
        meanwhile(os.getpid)()  # it is there
        shared = in_processes(where, jobs)
    alone = in_processes(where, jobs)
    assert [row[:2] for row in shared] == [row[:2] for row in alone]
    assert len({row[2] for row in shared}) == 2
    assert {row[2] for row in alone} == {os.getpid()}


def test_one_core_has_no_helpers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    with helpers():
        assert meanwhile(os.getpid)() == os.getpid()


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="semaphores cannot be seen here")
def test_no_semaphore_is_left_to_the_end_of_the_interpreter(two_cores: None) -> None:
    def semaphores() -> list[Path]:
        return list(Path("/dev/shm").glob(f"sem.loky-{os.getpid()}-*"))

    gc.collect()
    gc.disable()  # what is left is not to be collected by chance
    try:
        with helpers():
            assert meanwhile(os.getpid)() != os.getpid()
            assert semaphores()
            slow = threading.Thread(target=time.sleep, args=(1.0,), name="QueueFeederThread", daemon=True)
            slow.start()
        assert not slow.is_alive()
        assert not semaphores()
    finally:
        gc.enable()


def test_meanwhile_something_is_done_elsewhere(two_cores: None) -> None:
    with helpers():
        assert meanwhile(os.getpid)() != os.getpid()
    with helpers(), pytest.raises(ZeroDivisionError):
        meanwhile(divmod, 1, 0)()


class Remembers:
    """It changes what it is in while it is copied, as another thread may."""

    def __init__(self, held: dict[str, object]) -> None:
        self.held = held

    def __reduce__(self) -> tuple[type, tuple[()]]:
        self.held[f"found {len(self.held)}"] = None
        return object, ()


def test_what_changes_while_it_is_copied_is_done_here(two_cores: None) -> None:
    held: dict[str, object] = {}
    held |= {"itself": Remembers(held), "more": None}
    with helpers():
        assert meanwhile(lambda given: (len(given) >= 2, os.getpid()), held)() == (True, os.getpid())
        assert len(held) > 2  # it was tried
        assert meanwhile(os.getpid)() != os.getpid()  # the helper goes on
        with worker_pool() as pool:
            assert all(n >= 2 for n in pool.map(len, [held] * 4))


def killed(file: Path) -> int:
    """Kills the process that does it, unless that is the one that says so in a file."""
    if os.getpid() != int(file.read_text()):
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def test_what_a_killed_helper_was_to_do_is_done_here(two_cores: None, tmp_path: Path) -> None:
    file = tmp_path / "process"
    file.write_text(str(os.getpid()))
    with helpers():
        assert meanwhile(killed, file)() == os.getpid()
        assert meanwhile(killed, file)() == os.getpid()  # also when it is known to be gone
        with worker_pool() as pool:
            assert set(pool.map(killed, [file] * 8)) == {os.getpid()}
