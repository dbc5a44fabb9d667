"""`python -m models.LAW` and `skred` as programs: help at once, errors without traceback, one run."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

LAWS = ("coulomb", "pcm", "constant", "voellmy")
COMMANDS = [["-m", f"models.{law}"] for law in LAWS]
COMMANDS += [
    ["-m", "skred.cli", *command] for command in ([], ["validate"], ["compare"], ["diagnose"], ["import"])
]
HELP_SECONDS = 3.0
"""The bar is 1 s on a quiet machine (measured: 0.40 to 0.68 s); this leaves room for a busy one."""


def run(*arguments: str, cwd: Path | None = None, timeout: float = 120) -> subprocess.CompletedProcess[str]:
    # As a user runs it, where warnings are not errors; and no terminal codes in what is compared.
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "200", "PYTHONWARNINGS": "default"}
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment,
        timeout=timeout,
        check=False,
    )


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: " ".join(command[1:]))
def test_help_is_instant(command: list[str]) -> None:
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        done = run(*command, "--help")
        seconds.append(time.perf_counter() - started)
        assert done.returncode == 0 and "Usage" in done.stdout and done.stderr == ""
        if seconds[-1] < 1.0:
            break
    assert min(seconds) < HELP_SECONDS, seconds


def test_help_imports_nothing_heavy() -> None:
    """What makes it instant, whatever the machine does meanwhile."""
    code = (
        "import sys; from skred.cli.run_model import run_model\n"
        "sys.argv = ['pcm', '--help']\n"
        "try: run_model('pcm')\n"
        "except SystemExit: pass\n"
        "heavy = 'pymc', 'pytensor', 'arviz', 'xarray', 'pandas', 'matplotlib', 'numba'\n"
        "print([module for module in heavy if module in sys.modules])"
    )
    assert run("-c", code).stdout.strip().endswith("[]")


BAD = [
    ["--draws", "0"],
    ["--draws", "many"],
    ["--tune", "0"],
    ["--chains", "1"],
    ["--seed", "-1"],
    ["--sampler", "x"],
    ["--smoothing", "-3"],
    ["--campaign", "nowhere"],
    ["--no-such-option"],
    ["stray"],
]


@pytest.mark.parametrize("options", BAD, ids=" ".join)
def test_bad_options_are_told(options: list[str], tmp_path: Path) -> None:
    done = run("-m", "models.pcm", *options, cwd=tmp_path)
    told = done.stdout + done.stderr
    assert done.returncode == 2, told
    assert "Traceback" not in told and told.strip()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--models", "pcm,bingham"], "bingham"),
        (["--models", ","], "--models"),
        (["nowhere"], "nowhere"),
        (["--draws", "0"], "draws"),
    ],
)
def test_bad_comparisons_are_told(options: list[str], word: str, tmp_path: Path) -> None:
    done = run("-m", "skred.cli", "compare", *options, cwd=tmp_path)
    told = done.stdout + done.stderr
    assert done.returncode == 2 and "Traceback" not in told and word in told
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    out = tmp_path_factory.mktemp("program") / "new" / "folder"
    done = run(
        *"-m models.constant --draws 200 --tune 200 --chains 2 --seed 1 --out".split(),
        str(out),
        timeout=300,
    )
    return out, done


@pytest.mark.slow
def test_a_run_writes_everything(finished: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = finished
    assert done.returncode in (0, 1), done.stderr
    assert "Traceback" not in done.stderr and "Warning" not in done.stderr, done.stderr
    files = {file.name for file in out.iterdir()}
    assert {"posterior.nc", "summary.json"} <= files
    assert any(name.endswith(".png") for name in files)
    assert [name for name in files if name.startswith(".")] == [".skred-written.json"]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["id"] == "constant" and summary["settings"]["draws"] == 200
    assert summary["gate"]["passed"] is (done.returncode == 0)
    [parameter] = summary["parameters"]
    assert parameter["name"] == "retardation" and 4.4 < parameter["mean"] < 4.9
    assert "retardation" in done.stdout and str(out) in done.stdout.replace("\n", "")


def test_results_are_not_replaced_without_force(
    finished: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    out, _ = finished
    before = {file.name: file.stat().st_mtime_ns for file in out.iterdir()}
    done = run("-m", "models.constant", "--draws", "200", "--out", str(out))
    assert done.returncode == 2 and "--force" in done.stderr and "Traceback" not in done.stderr
    assert {file.name: file.stat().st_mtime_ns for file in out.iterdir()} == before
