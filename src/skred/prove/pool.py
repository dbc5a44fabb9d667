"""Who does the work: Dask workers, here or elsewhere."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from skred.errors import InputError

_MANY = 1_000_000
Job = dict[str, Any]


@dataclass(frozen=True)
class WorkerPool:
    """How many work, and where.

    Attributes
    ----------
    workers : int
        Processes of a cluster on this machine.
    scheduler : str, optional
        Address of a Dask scheduler instead. Its workers must see the same files and have the same code.
    patience_s : float
        How long to wait for the first worker, s.
    """

    workers: int = 2
    scheduler: str | None = None
    patience_s: float = 60.0

    @contextmanager
    def client(self) -> Iterator[Any]:
        """A Dask client; a cluster on this machine is gone afterwards, whatever happened."""
        there = (
            _client_of(self.scheduler, self.patience_s)
            if self.scheduler
            else _local_client(self.workers, self.patience_s)
        )
        with there as client:
            yield client

    def carry_out(
        self,
        work: Callable[[Job], Job],
        jobs: Sequence[Job],
        done: Callable[[Job, Job], None],
        lost: Callable[[Job], None],
    ) -> None:
        """Do jobs, in order of their list as far as workers are free.

        Parameters
        ----------
        work : callable
            What a worker does with a job; small plain data go in and come out.
        jobs : sequence of dict
            Each with the name of its trial.
        done : callable
            Is told of each job and what came out as it is finished.
        lost : callable
            Is told of a job that Dask has given up, because every worker that took it died.
        """
        if not jobs:
            return
        with self.client() as client:
            dask = _distributed()
            futures = {
                client.submit(work, job, key=f"{job['trial']}-{uuid.uuid4().hex}", pure=False): job
                for job in jobs
            }
            for future in dask.as_completed(list(futures), loop=client.loop):
                job = futures.pop(future)
                try:
                    result = future.result()
                except dask.KilledWorker:
                    lost(job)
                    continue
                future.release()
                done(job, result)


def _distributed() -> Any:
    """Dask's scheduler, which has no types."""
    import distributed

    return distributed


@contextmanager
def _local_client(workers: int, patience_s: float) -> Iterator[Any]:
    """A cluster of processes on this machine; each worker does one job at a time."""
    import dask

    distributed = _distributed()
    settings = {
        # What was only waiting on a worker that died is not to blame; the jobs count their own deaths.
        "distributed.scheduler.allowed-failures": _MANY,
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.comm.timeouts.connect": f"{patience_s}s",
        # Jobs are few and long; by default Dask watches itself fifty times a second and more.
        "distributed.worker.profile.enabled": False,
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.tick.cycle": "5s",
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            # Any free port, or a second cluster on the machine would warn that the usual one is taken.
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@contextmanager
def _client_of(scheduler: str, patience_s: float) -> Iterator[Any]:
    """A client of a scheduler that is there already."""
    try:
        # Not the default of the process: one that finds nobody would stay it, and whatever is written
        # to a netCDF file afterwards would ask it for a lock.
        client = _distributed().Client(scheduler, timeout=f"{patience_s}s", set_as_default=False)
        try:
            client.wait_for_workers(1, timeout=patience_s)
        except TimeoutError:
            client.close()
            raise
    except (OSError, TimeoutError, ValueError) as error:
        message = f"--scheduler {scheduler}: no Dask scheduler with a worker answers there"
        raise InputError(message) from error
    with client:
        yield client
