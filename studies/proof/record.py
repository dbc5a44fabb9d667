"""The published record: ledgers, opened truths with their salts, answers.

A batch is one ledger. All batches are in one archive, ``studies/results/proof.tar.xz``; of each it has
``<seed>/ledger.json`` as it was published, ``<seed>/sealed.json``, what the ledger's hashes are of, and
``<seed>/answers/<method>.json``. What was sealed is kept to the last digit, in columns: one list for each
key, with one entry a trial (a tenth smaller: salts stand by salts). Answers have one trial a line and four
digits; those of baselines are kept of the largest batch, of others the seed draws the campaigns again.
``notes/<seed>.md`` is what was written about a batch after it was opened, or why it was given up.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.files import as_columns, as_rows, rounded
from skred.output import plain
from skred.prove.scorecard import DIAGNOSIS
from skred.prove.scoring.answers import Pair, pairs_of
from studies.proof.archive import read_archive, write_archive

ARCHIVE = Path(__file__).resolve().parents[1] / "results" / "proof.tar.xz"
NOTES = Path(__file__).resolve().parent / "notes"
DIGITS = 4
"""Significant digits of what is kept of an answer."""
LEFT_OUT = (
    "predictors",
    "identifiability",
    "detection_limits",
    "candidates",
    "missing_work",
    "missing_work_of",
    "profile",
    "held_out",
    "next_sensor",
    "diagnostics",
    "equation",
    "statement",
    "conditional",
    "influence",
    "detection_sensor",
    "calibration",
)
"""Most of the volume of an answer, and neither scored nor read by a study. The first three are of the
campaign, which its seed draws again."""
Found = dict[str, Any]


@dataclass(frozen=True)
class Batch:
    """One ledger and what belongs to it.

    Attributes
    ----------
    name : str
        Its seed.
    """

    name: str


@cache
def _files() -> dict[str, bytes]:
    return read_archive(ARCHIVE)


def names() -> list[str]:
    """Names of all files of the record, such as ``36048904/ledger.json``."""
    return list(_files())


def batches() -> list[Batch]:
    """All batches, by seed."""
    return [Batch(seed) for seed in sorted({name.partition("/")[0] for name in names()}, key=int)]


def is_open(batch: Batch) -> bool:
    """Whether a batch has been revealed; until then there is its ledger alone."""
    return f"{batch.name}/sealed.json" in _files()


def opened_batches() -> list[Batch]:
    """Those that were revealed."""
    return [one for one in batches() if is_open(one)]


def ledger_of(batch: Batch) -> Found:
    """What was published before the first diagnosis."""
    return dict(_read(f"{batch.name}/ledger.json"))


def sealed_of(batch: Batch) -> dict[str, Found]:
    """What was sealed, by trial; each with its ``truth`` and its salt."""
    return {one["trial"]: one for one in as_rows(_read(f"{batch.name}/sealed.json"))}


def answers_of(batch: Batch) -> dict[str, dict[str, Found]]:
    """What each method answered, by trial."""
    folder = f"{batch.name}/answers/"
    return {Path(name).stem: _read(name) for name in names() if name.startswith(folder)}


def notes_of(batch: Batch) -> str:
    """What was written about a batch after it was opened or given up; empty where nothing was."""
    file = NOTES / f"{batch.name}.md"
    return file.read_text(encoding="utf-8") if file.exists() else ""


def missed() -> str:
    """Why the largest batch missed some criteria."""
    return (NOTES / "missed.md").read_text(encoding="utf-8")


def diagnosed(batch: Batch) -> list[Pair]:
    """Truth and diagnosis of every trial of an opened batch."""
    return pairs_of(list(sealed_of(batch).values()), answers_of(batch)[DIAGNOSIS])


def add(folder: Path) -> None:
    """Take a revealed proof folder into the record."""
    write_archive(ARCHIVE, _files() | kept_of(folder))
    _files.cache_clear()


def kept_of(folder: Path) -> dict[str, bytes]:
    """What the record keeps of a revealed proof folder: its files, by name; the ledger of one given up."""
    published = (folder / "ledger.json").read_bytes()  # kept as it was published, to the last byte
    ledger = json.loads(published)
    seed, trials = ledger["seed"], [entry["trial"] for entry in ledger["trials"]]
    files = {f"{seed}/ledger.json": published}
    if not (folder / "answers").exists():
        return files
    for method in sorted((folder / "answers").iterdir()):
        answers = {name: kept(_answer(folder, method.name, name)) for name in trials}
        files[f"{seed}/answers/{method.name}.json"] = by_line(answers).encode()
    sealed = [json.loads((folder / "sealed" / f"{name}.json").read_text("utf-8")) for name in trials]
    files[f"{seed}/sealed.json"] = json.dumps(as_columns(sealed), separators=(",", ":")).encode()
    return files


def kept(answer: Mapping[str, Any]) -> Found:
    """What is kept of an answer."""
    return {key: rounded(plain(value), DIGITS) for key, value in answer.items() if key not in LEFT_OUT}


def by_line(trials: Mapping[str, Any]) -> str:
    """A JSON object with one trial a line."""
    lines = (f"{json.dumps(name)}: {json.dumps(one, allow_nan=False)}" for name, one in trials.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _read(name: str) -> Any:
    return json.loads(_files()[name])


def _answer(folder: Path, method: str, name: str) -> Found:
    """An answer, its realised gain with it."""
    answer = dict(json.loads((folder / "answers" / method / f"{name}.json").read_text(encoding="utf-8")))
    gain = folder / "gains" / method / f"{name}.json"
    if gain.exists():
        found = json.loads(gain.read_text(encoding="utf-8"))["gain"]
        answer["gain"] = {**(answer.get("gain") or {}), **found}
    return answer
