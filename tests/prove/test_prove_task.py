"""The process that diagnoses works in a folder made for it, and removes nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from prove_cases import fake

from skred.prove.child import answer_of
from skred.prove.folder import ProofFolder
from skred.prove.task import MARKER, TOKEN

STARTER = """
import subprocess, sys, time
started = subprocess.Popen(sys.argv[1:], start_new_session=True)
print(started.pid, flush=True)
time.sleep(60)
"""
"""A parent that can be killed."""


def wait_until(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    """A person's folder that looks as one for a trial does."""
    folder = tmp_path / "precious"
    (folder / "campaign").mkdir(parents=True)
    (folder / "campaign" / "track.csv").write_text("x_m,z_m\n0,1\n")
    (folder / "thesis.tex").write_text("years of work")
    return folder


@pytest.mark.parametrize("marker", [None, "", "another"])
@pytest.mark.parametrize("token", [None, "", "one"])
def test_by_hand_it_touches_nothing(precious: Path, marker: str | None, token: str | None) -> None:
    if marker is not None:
        (precious / MARKER).write_text(marker)
    before = contents(precious)
    environment = {key: value for key, value in os.environ.items() if key != TOKEN}
    done = subprocess.run(
        [sys.executable, "-m", "skred.prove.task", "pcm", "{}"],
        cwd=precious,
        env=environment if token is None else environment | {TOKEN: token},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert "nothing was touched" in done.stderr and "Traceback" not in done.stderr
    assert contents(precious) == before


def test_when_its_parent_ends_it_ends_and_removes_nothing(precious: Path) -> None:
    (precious / MARKER).write_text("one")
    before = contents(precious)
    parent = subprocess.Popen(
        [sys.executable, "-c", STARTER, sys.executable, fake("endless"), "pcm", "{}"],
        cwd=precious,
        env=os.environ | {TOKEN: "one"},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert parent.stdout is not None
    task = int(parent.stdout.readline())
    wait_until(lambda: is_running(task))
    time.sleep(2.0)  # so long that it has begun to watch
    assert is_running(task)
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    wait_until(lambda: not is_running(task))
    assert contents(precious) == before


def test_what_a_killed_worker_left_is_removed_by_the_next(
    proof: ProofFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of folders in the place for temporary files, those that workers marked; and none of anybody else."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, other = tmp_path / "campaign-left", tmp_path / "campaign-of-a-person"
    for folder in (left, other):
        (folder / "campaign").mkdir(parents=True)
    (left / MARKER).write_text("token")
    answer = answer_of(proof.campaign("trial-0001"), "pcm", {}, 60.0, fake("quick"))
    assert answer["verdict"] == "nothing_missing"
    assert not left.exists() and other.exists()
    assert [one.name for one in tmp_path.glob("campaign-*")] == ["campaign-of-a-person"]
