"""The published record: what stands in it is what was sealed, and every trial is answered."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from skred.prove.folder import METHOD
from skred.prove.hashes import document_sha256
from skred.prove.ledger import ledger_sha256

RECORD = Path(__file__).parents[2] / "benchmarks" / "results" / "proof"
OPENED = sorted(file.parent for file in RECORD.glob("*/sealed.json"))


def read(file: Path) -> dict[str, Any]:
    return dict(json.loads(file.read_text(encoding="utf-8")))


def changed(ledger: dict[str, Any], sealed: dict[str, Any]) -> list[str]:
    """Trials that are not what their hash was published of."""
    published = {entry["trial"]: entry["sha256"] for entry in ledger["trials"]}
    return [
        name
        for name in published.keys() | sealed.keys()
        if name not in sealed or document_sha256(sealed[name]) != published.get(name)
    ]


def test_a_blind_run_of_300_trials_is_in_it() -> None:
    largest = max(OPENED, key=lambda batch: read(batch / "ledger.json")["n"])
    truths = [one["truth"] for one in read(largest / "sealed.json").values()]
    clean = [truth for truth in truths if not truth["mechanisms"]]
    assert len(truths) >= 300
    assert len(clean) >= 120
    assert sum(truth["hidden"] == "nasty" for truth in clean) * 2 >= len(clean)


@pytest.mark.parametrize("batch", OPENED, ids=lambda batch: batch.name)
def test_truths_are_those_that_were_sealed(batch: Path) -> None:
    ledger, sealed = read(batch / "ledger.json"), read(batch / "sealed.json")
    assert str(ledger["seed"]) == batch.name
    assert changed(ledger, sealed) == []
    name = next(iter(sealed))
    other = copy.deepcopy(sealed)
    other[name]["truth"]["snr"] += 0.001
    assert changed(ledger, other) == [name]


@pytest.mark.parametrize("batch", OPENED, ids=lambda batch: batch.name)
def test_every_trial_is_answered_once_and_to_this_ledger(batch: Path) -> None:
    ledger = read(batch / "ledger.json")
    answers = read(batch / "answers" / f"{METHOD}.json")
    assert list(answers) == [entry["trial"] for entry in ledger["trials"]]
    sha256 = ledger_sha256(ledger)
    assert {answer["ledger_sha256"] for answer in answers.values() if "ledger_sha256" in answer} == {sha256}


@pytest.mark.parametrize("file", sorted(RECORD.rglob("*.json")), ids=lambda f: str(f.relative_to(RECORD)))
def test_files_are_small(file: Path) -> None:
    assert file.stat().st_size < 2 * 2**20
