"""Running: one answer for each trial, whatever happens to diagnoses, workers and the command itself."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import distributed
import pytest
from prove_cases import PLAN, Alone, fake, silent

from skred.errors import InputError
from skred.output import alone_in
from skred.prove.folder import ProofFolder, read_object
from skred.prove.ledger import read_ledger, trial_names
from skred.prove.pool import WorkerPool
from skred.prove.run import Limits, run

DRIVER = Path(__file__).parent / "prove_driver.py"
Diagnosed = Callable[..., dict[str, int]]


def answers_of(proof: ProofFolder) -> dict[str, dict[str, Any]]:
    files = sorted(proof.answer("any").parent.glob("*.json"))
    return {file.stem: read_object(file) for file in files}


def command(proof: ProofFolder, name: str, *options: str) -> list[str]:
    return [sys.executable, str(DRIVER), fake(name), "prove", "run", str(proof.path), *options]


def started(proof: ProofFolder, name: str, *options: str) -> subprocess.Popen[str]:
    """The command in a process of its own, as a shell would start it: a group for Ctrl-C."""
    return subprocess.Popen(
        command(proof, name, *options),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )


def still_there(proof: ProofFolder) -> list[str]:
    """Processes that were started for a proof: workers have its driver's words, or a neutral folder."""
    found = []
    for process in Path("/proc").iterdir():
        try:
            words = (process / "cmdline").read_bytes().decode(errors="replace").replace("\0", " ")
        except OSError:
            continue
        if str(proof.path) in words or f"{os.sep}fakes{os.sep}slow" in words:
            found.append(words)
    return found


def wait_until(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def test_every_trial_is_answered_once(proof: ProofFolder, diagnosed: Diagnosed) -> None:
    assert diagnosed(proof, "quick") == {"answered": 3, "before": 0, "crashed": 0, "late": 0}
    first = answers_of(proof)
    assert list(first) == trial_names(read_ledger(proof))
    for name, answer in first.items():
        assert answer["trial"] == name and answer["verdict"] == "nothing_missing"
        assert answer["base_model"] == read_object(proof.request(name))["base_model"]
        assert 0.0 < answer["cpu_seconds"] < 60.0 and answer["wall_seconds"] > 0.0
    assert diagnosed(proof, "quick") == {"answered": 0, "before": 3, "crashed": 0, "late": 0}
    assert answers_of(proof) == first
    proof.answer("trial-0002").unlink()
    assert diagnosed(proof, "quick")["answered"] == 1
    again = answers_of(proof)
    assert again.pop("trial-0002") != first.pop("trial-0002") and again == first


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("crashing", "ArithmeticError"),
        ("dying", "code -9"),
        ("wordless", "no verdict"),
        ("missing", "code 2"),
    ],
)
def test_a_crash_is_an_answer(proof: ProofFolder, diagnosed: Diagnosed, name: str, error: str) -> None:
    assert diagnosed(proof, name)["crashed"] == 3
    for answer in answers_of(proof).values():
        assert answer["verdict"] == "crash" and error in answer["error"]
        assert "campaign-" not in answer["error"] + answer["traceback"]
        assert sys.prefix not in answer["error"] + answer["traceback"]


def test_time_is_limited(proof: ProofFolder, diagnosed: Diagnosed) -> None:
    for name in trial_names(read_ledger(proof))[1:]:
        proof.answer(name).parent.mkdir(parents=True, exist_ok=True)
        proof.answer(name).write_text('{"verdict": "cannot_tell"}')
    started_at = time.monotonic()
    assert diagnosed(proof, "endless", 0.5) == {"answered": 1, "before": 2, "crashed": 0, "late": 1}
    assert time.monotonic() - started_at < 20.0
    answer = answers_of(proof)["trial-0001"]
    assert answer["verdict"] == "timeout" and answer["time_limit_s"] == 0.5


def test_other_source_is_refused(proof: ProofFolder) -> None:
    ledger = read_ledger(proof)
    proof.ledger.write_text(json.dumps(ledger | {"source_sha256": "0" * 64}))
    with pytest.raises(InputError, match="check out the source"):
        run(proof, Alone(), silent, silent)


def test_a_campaign_that_is_gone_is_told(proof: ProofFolder, diagnosed: Diagnosed) -> None:
    proof.request("trial-0003").unlink()
    with pytest.raises(InputError, match="trial-0003"):
        diagnosed(proof, "quick")
    assert answers_of(proof) == {}


def test_one_command_at_a_time(proof: ProofFolder, diagnosed: Diagnosed) -> None:
    with alone_in(proof.path, "test"), pytest.raises(InputError, match="another"):
        diagnosed(proof, "quick")
    assert diagnosed(proof, "quick")["answered"] == 3


def test_no_scheduler(proof: ProofFolder) -> None:
    with pytest.raises(InputError, match="no Dask scheduler"):
        run(proof, WorkerPool(1, "nonsense://x", patience_s=1.0), silent, silent)
    with pytest.raises(ValueError, match="No clients"):
        distributed.default_client()


@pytest.mark.slow
def test_a_dying_worker_is_replaced_and_its_trial_tried_once_more(proof: ProofFolder) -> None:
    proof.request("trial-0002").write_text('{"base_model": "murderous"}')
    done = subprocess.run(command(proof, "murderous"), capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    answers = answers_of(proof)
    assert {name: answer["verdict"] for name, answer in answers.items()} == {
        "trial-0001": "nothing_missing",
        "trial-0002": "crash",
        "trial-0003": "nothing_missing",
    }
    assert answers["trial-0002"]["error"] == "worker died twice"
    assert "1 crashed" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_kill_and_go_on(proof: ProofFolder) -> None:
    """Kill -9 between the first answer and the last: nothing is lost, and nothing done twice."""
    process = started(proof, "slow", "--workers", "1")
    wait_until(lambda: len(answers_of(proof)) >= 1)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    before = answers_of(proof)
    assert 1 <= len(before) < PLAN.n
    wait_until(lambda: not still_there(proof))
    assert answers_of(proof) == before
    done = subprocess.run(command(proof, "slow"), capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    assert f"diagnosing {PLAN.n - len(before)} of {PLAN.n} trials" in done.stderr
    after = answers_of(proof)
    assert len(after) == PLAN.n and {name: after[name] for name in before} == before
    assert len({answer["token"] for answer in after.values()}) == PLAN.n
    assert not list(proof.path.rglob(".*.json*")), "something is half written"


@pytest.mark.slow
def test_interruption(proof: ProofFolder) -> None:
    process = started(proof, "endless", "--workers", "1")
    wait_until(lambda: (proof.path / "attempts").is_dir())
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.rstrip().endswith("interrupted") and "Traceback" not in said
    wait_until(lambda: not still_there(proof))
    assert answers_of(proof) == {}


def test_what_is_run_by_default() -> None:
    assert Limits() == Limits(900.0, "skred.prove.task")


@pytest.mark.slow
def test_a_diagnosis_as_it_is(proof: ProofFolder) -> None:
    """One real diagnosis, sandbox and all; minutes."""
    for name in trial_names(read_ledger(proof))[1:]:
        proof.answer(name).parent.mkdir(parents=True, exist_ok=True)
        proof.answer(name).write_text('{"verdict": "cannot_tell"}')
    assert run(proof, Alone(), silent, silent)["crashed"] == 0
    answer = answers_of(proof)["trial-0001"]
    assert answer["verdict"] in ("nothing_missing", "cannot_tell")
    assert answer["probability"] or "gate" in answer["reason"]  # a failed gate is an answer too
