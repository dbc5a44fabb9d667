"""What programs end with, and that no traceback is told on the terminal."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from skred.campaign import CampaignError
from skred.campaign.problems import Problem
from skred.cli.diagnose import ends_with
from skred.cli.program import exit_code_of
from skred.errors import InputError
from skred.output import results_folder


def broken_run(out: Path, error: BaseException, wrote: str | None) -> Callable[[], object]:
    """A run that breaks off, having written a file or nothing."""

    def work() -> None:
        with results_folder(out, "compare") as results:
            if wrote is not None:
                (results.unfinished / wrote).write_text("{}")
            raise error

    return work


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("what to do"), 2, "error: what to do"),
        (CampaignError([Problem("a.csv", 3, "x", "7", "correct it")]), 2, "1 problem:\n  a.csv, row 3"),
        (PermissionError(13, "denied", "here"), 2, "cannot read or write: [Errno 13] denied: 'here'"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (ZeroDivisionError("by\nzero"), 3, "a fault of skred, not of the input (ZeroDivisionError: by zero)"),
        (ValueError("no input"), 3, "a fault of skred, not of the input (ValueError: no input)"),
        (MemoryError(), 3, "a fault of skred, not of the input (MemoryError:)"),
    ],
)
@pytest.mark.parametrize("wrote", [None, "verdict.json"])
def test_what_goes_wrong_is_told(
    error: BaseException,
    code: int,
    said: str,
    wrote: str | None,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    out = tmp_path / "out"
    assert exit_code_of(broken_run(out, error, wrote)) == code
    told = capfd.readouterr()
    assert told.out == "" and told.err.startswith(said) and "Traceback" not in told.err
    unfinished = out / ".skred-unfinished"
    if code == 3:
        assert told.err.count("\n") == 1
        assert told.err.endswith(f"the traceback is in {unfinished / 'traceback.txt'}\n")
        assert type(error).__name__ in (unfinished / "traceback.txt").read_text()
    if wrote is None and code != 3:
        assert not out.exists()
    if wrote is not None:
        assert str(unfinished) in told.err or isinstance(error, CampaignError)
        assert (unfinished / wrote).exists()


def test_a_fault_without_results_is_in_a_temporary_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert exit_code_of(lambda: [][1]) == 3
    (file,) = tmp_path.iterdir()
    assert capfd.readouterr().err.endswith(f"the traceback is in {file}\n")
    assert "IndexError" in file.read_text()


def test_a_fault_that_cannot_be_written_down() -> None:
    code = (
        "import sys, tempfile; from skred.cli.program import exit_code_of; "
        "tempfile.tempdir = '/nowhere'; sys.exit(exit_code_of(lambda: [][1]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 3
    assert done.stderr.endswith("its traceback could not be written\n") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ({"reason": None, "converged": True}, 0),
        ({"reason": "only 5 avalanches", "converged": True}, 0),
        ({"reason": "the chains did not converge", "converged": False}, 1),
        ({"reason": None, "converged": False}, 0),
    ],
)
def test_what_a_diagnosis_ends_with(document: dict[str, object], expected: int) -> None:
    """A verdict of which a refit did not converge is an answer, and says so."""
    assert ends_with(document) == expected


FAULT = """
import sys
import skred.inference.calibrate
from skred.cli.run_model import run_model

def calibrate(*given, **options):
    raise ArithmeticError("of \u00b1 our own")

skred.inference.calibrate.calibrate = calibrate
run_model("pcm")
"""


def test_a_law_as_a_program_tells_a_fault_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FAULT, "--out", "told"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        timeout=300,
        check=False,
    )
    assert done.returncode == 3, done.stderr
    stage, fault = done.stderr.splitlines()
    assert stage == "pcm: sampling" and "ArithmeticError: of +- our own" in fault
    assert "in calibrate" in (tmp_path / "told" / ".skred-unfinished" / "traceback.txt").read_text()
