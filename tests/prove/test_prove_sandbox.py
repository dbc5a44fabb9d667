"""The truth is out of reach of the process that diagnoses."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from prove_cases import fake

from skred.errors import InputError
from skred.prove.child import answer_of
from skred.prove.folder import ProofFolder, read_object
from skred.prove.sandbox import Sandbox, allowed_roots, within


def test_the_truth_is_unreachable(proof: ProofFolder) -> None:
    """A spy, run by what runs the diagnosis, and told where the truth is, which a diagnosis is not."""
    secret, ledger = proof.sealed("trial-0001"), proof.ledger
    before = secret.read_bytes()
    settings = {"secret": str(secret.resolve()), "ledger": str(ledger.resolve())}
    answer = answer_of(proof.campaign("trial-0001"), "pcm", settings, 60.0, fake("spying"))
    assert answer["verdict"] == "cannot_tell", answer.get("traceback")
    assert answer["reached"] == {}
    assert answer["able"] and len(answer["refused"]) > 20
    assert secret.read_bytes() == before
    assert all(one.endswith("PermissionError") for one in answer["refused"])


def test_what_it_is_told(proof: ProofFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIAL_SEED", "1234567")
    monkeypatch.chdir(proof.path)
    answer = answer_of(proof.campaign("trial-0001"), "pcm", {}, 60.0, fake("quick"))
    assert answer["base_model"] == "pcm"
    assert answer["files"] == ["campaign.toml", "events.csv", "recordings.csv", "sensors.csv", "track.csv"]


def test_links_are_followed_before_a_path_is_judged(tmp_path: Path) -> None:
    own, other = tmp_path / "own", tmp_path / "other"
    own.mkdir()
    other.mkdir()
    (own / "link").symlink_to(other)
    sandbox = Sandbox(own)
    sandbox("open", (str(own / "verdict.json"), "w", 0))
    sandbox("open", (3, "w", 0))
    sandbox("open", (os.fsencode(own / "new" / "file"), "w", 0))
    sandbox("os.listdir", (None,))
    sandbox("os.listdir", (str(own),))
    sandbox("subprocess.Popen", ("/usr/bin/g++", ["g++", "-v"], None, None))
    for path in (
        own / "link" / "x",
        own / ".." / "other" / "x",
        other,
        Path("/"),
        Path("/proc/self/environ"),
    ):
        with pytest.raises(PermissionError, match="may not reach"):
            sandbox("open", (str(path), "r", 0))
    for event, arguments in (
        ("os.listdir", (str(other),)),
        ("os.rename", (str(other / "x"), str(own / "x"), -1, -1)),
        ("os.symlink", ("../other", str(own / "again"), -1)),
        ("subprocess.Popen", ("/bin/cat", ["cat"], None, None)),
        ("os.system", (b"true",)),
    ):
        with pytest.raises(PermissionError):
            sandbox(event, arguments)


def test_python_the_package_and_its_laws_are_within() -> None:
    import numpy

    import models.pcm
    import skred.diagnosis.diagnose

    roots = allowed_roots()
    for module in (numpy, os, skred.diagnosis.diagnose, models.pcm):
        assert within(str(module.__file__), roots)
    assert Path("/") not in roots and Path.home() not in roots and not within(Path.home() / "x", roots)
    assert not within(Path(sys.prefix).parent / "skred-out" / "prove" / "sealed", roots)


def test_caches_that_are_not_there_yet_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A diagnosis may not make the folders above its caches itself."""
    numba, pytensor = tmp_path / "caches" / "numba", tmp_path / "caches" / "pytensor"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(numba))
    monkeypatch.setenv("PYTENSOR_FLAGS", f"base_compiledir={pytensor}")
    own = tmp_path / "own"
    own.mkdir()
    sandbox = Sandbox(own)
    assert numba.is_dir() and pytensor.is_dir()
    sandbox("os.mkdir", (str(pytensor / "compiled"), 0o777, -1))


def test_a_folder_that_diagnoses_may_read_is_refused(
    proof: ProofFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    from prove_cases import Alone, silent

    from skred.prove.run import run

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(proof.path.parent))
    with pytest.raises(InputError, match="may read there"):
        run(proof, Alone(), silent, silent)
    assert read_object(proof.ledger)
