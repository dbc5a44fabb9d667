"""A sealed proof of trials that hide nothing (they are drawn at once), answered or not."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from prove_cases import PLAN, Alone, fake, silent

from skred.prove.folder import ProofFolder


@pytest.fixture(scope="session")
def sealed_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from skred.prove.seal import seal

    folder = tmp_path_factory.mktemp("sealed") / "proof"
    seal(ProofFolder(folder), PLAN, Alone(), silent, silent)
    return folder


@pytest.fixture
def proof(sealed_once: Path, tmp_path: Path) -> ProofFolder:
    """Sealed; a copy for each test."""
    shutil.copytree(sealed_once, tmp_path / "proof")
    return ProofFolder(tmp_path / "proof")


@pytest.fixture
def answered(proof: ProofFolder) -> ProofFolder:
    """With an answer to every trial, written as a worker would."""
    from skred.prove.folder import write_once
    from skred.prove.ledger import ledger_sha256, read_ledger, trial_names

    ledger = read_ledger(proof)
    for name in trial_names(ledger):
        answer = {"verdict": "nothing_missing", "trial": name, "ledger_sha256": ledger_sha256(ledger)}
        write_once(proof.answer(name), answer | {"wall_seconds": 2.0, "cpu_seconds": 1.0})
    return proof


@pytest.fixture
def diagnosed() -> Callable[..., dict[str, int]]:
    """Run a proof here, with a fake."""
    from skred.prove.run import Limits, run

    def go(folder: ProofFolder, name: str, time_limit_s: float = 60.0) -> dict[str, int]:
        return run(folder, Alone(), silent, silent, Limits(time_limit_s, fake(name)))

    return go
