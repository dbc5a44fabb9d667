"""The published record: what stands in it is what was sealed, and every trial is answered."""

from __future__ import annotations

import copy
import io
import json
import lzma
import shutil
import tarfile
from pathlib import Path
from typing import Any

import pytest

from benchmarks.files import as_columns, as_rows
from skred.prove.folder import METHOD
from skred.prove.hashes import document_sha256
from skred.prove.ledger import ledger_sha256
from studies.proof import archive
from studies.proof.archive import ArchiveError, read_archive, write_archive
from studies.proof.record import (
    Batch,
    answers_of,
    kept_of,
    ledger_of,
    opened_batches,
    sealed_of,
)

OPENED = opened_batches()


def changed(ledger: dict[str, Any], sealed: dict[str, Any]) -> list[str]:
    """Trials that are not what their hash was published of."""
    published = {entry["trial"]: entry["sha256"] for entry in ledger["trials"]}
    return [
        name
        for name in published.keys() | sealed.keys()
        if name not in sealed or document_sha256(sealed[name]) != published.get(name)
    ]


def test_a_blind_run_of_300_trials_is_in_it() -> None:
    largest = max(OPENED, key=lambda batch: ledger_of(batch)["n"])
    truths = [one["truth"] for one in sealed_of(largest).values()]
    clean = [truth for truth in truths if not truth["mechanisms"]]
    assert len(truths) >= 300
    assert len(clean) >= 120
    assert sum(truth["hidden"] == "nasty" for truth in clean) * 2 >= len(clean)


@pytest.mark.parametrize("batch", OPENED, ids=lambda batch: batch.name)
def test_truths_are_those_that_were_sealed(batch: Batch) -> None:
    ledger, sealed = ledger_of(batch), sealed_of(batch)
    assert str(ledger["seed"]) == batch.name
    assert changed(ledger, sealed) == []
    name = next(iter(sealed))
    other = copy.deepcopy(sealed)
    other[name]["truth"]["snr"] += 0.001
    assert changed(ledger, other) == [name]


@pytest.mark.parametrize("batch", OPENED, ids=lambda batch: batch.name)
def test_every_trial_is_answered_once_and_to_this_ledger(batch: Batch) -> None:
    ledger, answers = ledger_of(batch), answers_of(batch)[METHOD]
    assert list(answers) == [entry["trial"] for entry in ledger["trials"]]
    sha256 = ledger_sha256(ledger)
    assert {answer["ledger_sha256"] for answer in answers.values() if "ledger_sha256" in answer} == {sha256}


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [1.5, None],
        [{"a": 1, "b": {"c": [1]}}, {"a": 2, "b": {"c": [2, 3]}}],
        [{"a": 1}, {"b": 2}],
        [{"a": {"b": 1}}, {"a": None}],
        [{}, {}],
    ],
)
def test_columns_are_the_rows_again(rows: list[Any]) -> None:
    assert as_rows(json.loads(json.dumps(as_columns(rows)))) == rows


def revealed(folder: Path) -> Path:
    """A proof folder with one trial."""
    documents = {
        "ledger.json": {"seed": 7, "trials": [{"trial": "trial-0001", "sha256": "0" * 64}]},
        "sealed/trial-0001.json": {"trial": "trial-0001", "salt": "ab", "truth": {"snr": 0.1 + 0.2}},
        "answers/skred/trial-0001.json": {"verdict": "unexplained", "power": 0.123456789, "candidates": [1]},
        "gains/skred/trial-0001.json": {"gain": {"realised": 0.5}},
    }
    for name, document in documents.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(json.dumps(document), encoding="utf-8")
    return folder


def test_a_batch_that_is_given_up_leaves_its_ledger(tmp_path: Path) -> None:
    folder = revealed(tmp_path / "proof")
    ledger = (folder / "ledger.json").read_bytes()
    shutil.rmtree(folder / "answers")
    assert kept_of(folder) == {f"{json.loads(ledger)['seed']}/ledger.json": ledger}


def test_a_batch_is_kept_and_the_same_batch_makes_the_same_archive(tmp_path: Path) -> None:
    files = kept_of(revealed(tmp_path / "proof"))
    for name in ("one.tar.xz", "other.tar.xz"):
        write_archive(tmp_path / name, dict(reversed(files.items())) if name == "one.tar.xz" else files)
    assert (tmp_path / "one.tar.xz").read_bytes() == (tmp_path / "other.tar.xz").read_bytes()
    found = {name: json.loads(content) for name, content in read_archive(tmp_path / "one.tar.xz").items()}
    assert found["7/ledger.json"]["seed"] == 7
    assert as_rows(found["7/sealed.json"])[0]["truth"] == {"snr": 0.1 + 0.2}
    kept = {"verdict": "unexplained", "power": 0.1235, "gain": {"realised": 0.5}}
    assert found["7/answers/skred.json"]["trial-0001"] == kept


def tar_of(*members: tarfile.TarInfo) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:") as made:
        for member in members:
            made.addfile(member, io.BytesIO(bytes(member.size)))
    return buffer.getvalue()


def link() -> tarfile.TarInfo:
    member = tarfile.TarInfo("7/ledger.json")
    member.type, member.linkname = tarfile.SYMTYPE, "/etc/hostname"
    return member


@pytest.mark.parametrize(
    "content",
    [
        tar_of(tarfile.TarInfo("../ledger.json")),
        tar_of(tarfile.TarInfo("/7/ledger.json")),
        tar_of(tarfile.TarInfo("7/ledger.json"), tarfile.TarInfo("7/ledger.json")),
        tar_of(link()),
        bytes(archive.MOST_BYTES + 1),
    ],
    ids=["outside", "absolute", "twice", "link", "too large"],
)
def test_what_does_not_belong_in_an_archive_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "bad.tar.xz"
    file.write_bytes(lzma.compress(content, preset=0))
    with pytest.raises(ArchiveError):
        read_archive(file)


def test_an_archive_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "cut.tar.xz"
    write_archive(file, {"7/ledger.json": b"{}" * 1000})
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(ArchiveError):
        read_archive(file)
