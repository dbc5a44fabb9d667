"""The published record on disk: ledgers, opened truths with their salts, answers.

A batch is one ledger, in ``results/proof/<seed>/``: ``ledger.json`` as it was published, ``sealed.json`` what
the ledger's hashes are of, and ``answers/<method>.json``. The latter two have one trial a line, so that they
stay small and a line is what changes.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skred.output import plain, write_text
from skred.prove.scorecard import DIAGNOSIS
from skred.prove.scoring.answers import Pair, pairs_of

RECORD = Path(__file__).resolve().parent / "results" / "proof"
DIGITS = 6
"""Significant digits of what is kept of an answer; what is sealed is kept to the last, for its hash."""
LEFT_OUT = ("predictors", "identifiability", "detection_limits")
"""Not of the answer but of the campaign, which its seed draws again; most of the volume."""
Found = dict[str, Any]


def batches() -> list[Path]:
    """The folders of all batches, by seed."""
    return sorted((one for one in RECORD.iterdir() if one.is_dir()), key=lambda one: int(one.name))


def is_open(batch: Path) -> bool:
    """Whether a batch has been revealed; until then its folder holds the ledger alone."""
    return (batch / "sealed.json").exists()


def opened_batches() -> list[Path]:
    """The folders of those that were revealed."""
    return [one for one in batches() if is_open(one)]


def ledger_of(batch: Path) -> Found:
    """What was published before the first diagnosis."""
    return dict(json.loads((batch / "ledger.json").read_text(encoding="utf-8")))


def sealed_of(batch: Path) -> dict[str, Found]:
    """What was sealed, by trial; each with its ``truth`` and its salt."""
    return dict(json.loads((batch / "sealed.json").read_text(encoding="utf-8")))


def answers_of(batch: Path) -> dict[str, dict[str, Found]]:
    """What each method answered, by trial."""
    files = sorted((batch / "answers").glob("*.json"))
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in files}


def diagnosed(batch: Path) -> list[Pair]:
    """Truth and diagnosis of every trial of an opened batch."""
    return pairs_of(list(sealed_of(batch).values()), answers_of(batch)[DIAGNOSIS])


def add(folder: Path) -> None:
    """Take a revealed proof folder into the record."""
    ledger = json.loads((folder / "ledger.json").read_text(encoding="utf-8"))
    target = RECORD / str(ledger["seed"])
    names = [entry["trial"] for entry in ledger["trials"]]
    (target / "answers").mkdir(parents=True, exist_ok=True)
    # As it was published, to the last byte.
    shutil.copyfile(folder / "ledger.json", target / "ledger.json")
    for method in sorted((folder / "answers").iterdir()):
        answers = {name: kept(_answer(folder, method.name, name)) for name in names}
        write_text(target / "answers" / f"{method.name}.json", by_line(answers))
    sealed = {name: json.loads((folder / "sealed" / f"{name}.json").read_text("utf-8")) for name in names}
    write_text(target / "sealed.json", by_line(sealed))


def kept(answer: Mapping[str, Any]) -> Found:
    """What is kept of an answer."""
    return {key: _rounded(plain(value)) for key, value in answer.items() if key not in LEFT_OUT}


def by_line(trials: Mapping[str, Any]) -> str:
    """A JSON object with one trial a line."""
    lines = (f"{json.dumps(name)}: {json.dumps(one, allow_nan=False)}" for name, one in trials.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _answer(folder: Path, method: str, name: str) -> Found:
    """An answer, its realised gain with it."""
    answer = dict(json.loads((folder / "answers" / method / f"{name}.json").read_text(encoding="utf-8")))
    gain = folder / "gains" / method / f"{name}.json"
    if gain.exists():
        found = json.loads(gain.read_text(encoding="utf-8"))["gain"]
        answer["gain"] = {**(answer.get("gain") or {}), **found}
    return answer


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value
