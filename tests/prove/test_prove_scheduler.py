"""Trials on workers of a Dask scheduler that runs already, in processes of their own."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from prove_cases import fake, silent

from skred.prove.folder import ProofFolder, read_object
from skred.prove.ledger import read_ledger, trial_names
from skred.prove.pool import WorkerPool
from skred.prove.run import Limits, run

_PATIENCE_S = 60.0


class Cluster(NamedTuple):
    """A scheduler's address, and the processes of its workers."""

    address: str
    workers: list[subprocess.Popen[bytes]]


def started(module: str, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.{module}", "--no-dashboard", *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    file = tmp_path / "scheduler.json"
    place = ("--scheduler-file", str(file))
    processes = [started("dask_scheduler", "--host", "127.0.0.1", "--port", "0", *place)]
    try:
        end = time.monotonic() + _PATIENCE_S
        while not file.exists() or not file.read_text():
            assert time.monotonic() < end and processes[0].poll() is None, "no scheduler came up"
            time.sleep(0.05)
        alone = ("--nworkers", "1", "--nthreads", "1", "--local-directory", str(tmp_path))
        processes += [started("dask_worker", *place, *alone) for _ in range(2)]
        yield Cluster(json.loads(file.read_text())["address"], processes[1:])
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_trials_run_on_a_scheduler_that_is_there(proof: ProofFolder, cluster: Cluster) -> None:
    limits = Limits(60.0, fake("quick"))
    found = run(proof, WorkerPool(1, cluster.address), silent, silent, limits)
    assert found == {"answered": 3, "before": 0, "crashed": 0, "late": 0}
    for name in trial_names(read_ledger(proof)):
        assert read_object(proof.answer(name))["verdict"] == "nothing_missing"
    assert [worker.poll() for worker in cluster.workers] == [None, None]  # it is not ours to end


@pytest.mark.slow
def test_a_worker_elsewhere_that_dies_is_its_trials_answer(proof: ProofFolder, cluster: Cluster) -> None:
    """Its own nanny starts it again; the other trials are answered."""
    first, *others = trial_names(read_ledger(proof))
    proof.request(first).write_text('{"base_model": "murderous"}')
    found = run(proof, WorkerPool(1, cluster.address), silent, silent, Limits(60.0, fake("murderous")))
    assert found["answered"] == 3 and found["crashed"] == 1
    assert read_object(proof.answer(first))["error"] == "worker died twice"
    assert [read_object(proof.answer(name))["verdict"] for name in others] == ["nothing_missing"] * 2
