"""`skred prove` as a person calls it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from prove_cases import fake

from skred.cli.main import run
from skred.prove.folder import ProofFolder

DRIVER = Path(__file__).parent / "prove_driver.py"


@pytest.mark.parametrize("command", [(), ("seal",), ("run",), ("reveal",), ("show",)])
def test_help_needs_no_heavy_imports(command: tuple[str, ...]) -> None:
    code = (
        "import sys; from skred.cli.main import run; code = run(sys.argv[1:]); "
        "heavy = {'numpy', 'distributed', 'pymc', 'numba', 'scipy'} & set(sys.modules); "
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "prove", *command, "--help"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert "--" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "--trials"),
        (["--trials", "3", "--seed", "5", "--out", "{folder}"], "development"),
        (["seal", "{folder}"], "--trials"),
        (["run", "{folder}"], "no ledger"),
        (["reveal", "{folder}/nowhere"], "no such folder"),
        (["show", "1", "--out", "{folder}"], "no ledger"),
        (["run", "{folder}", "--workers", "0"], ""),
        (["--trials", "3", "--out", "{folder}/taken"], "holds files"),
    ],
)
def test_bad_use_ends_with_2(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "file").write_text("")
    assert run(["prove", *(word.format(folder=tmp_path) for word in words)]) == 2
    assert message in capsys.readouterr().err


def test_all_in_one_and_again(tmp_path: Path) -> None:
    """Two trials that hide nothing, sealed, answered by a fake, and scored."""
    pytest.importorskip("skred.report.scorecard.page")
    out = tmp_path / "proof"
    words = ["prove", "--trials", "2", "--seed", "7", "--quick", "--nothing-share", "1", "--out", str(out)]
    words += ["--workers", "1"]
    command = [sys.executable, str(DRIVER), fake("quick"), *words]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert json.loads(done.stdout) == json.loads((out / "scorecard.json").read_text())
    before = {file: file.read_bytes() for file in (out / "answers").rglob("*.json")}
    assert len(before) == 2 and ProofFolder(out).ledger.exists()
    again = subprocess.run(
        [*command[:3], "prove", "run", str(out), "--workers", "1"],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert again.returncode == 0, again.stderr
    assert "answered: 0 now, 2 before" in again.stderr
    assert {file: file.read_bytes() for file in (out / "answers").rglob("*.json")} == before
