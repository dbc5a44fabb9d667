"""The published record on disk: ledgers, opened truths with their salts, answers.

A batch is one ledger, in ``results/proof/<seed>/``: ``ledger.json`` as it was published, ``sealed.json`` what
the ledger's hashes are of, ``answers/<method>.json``, and ``notes.md`` with what was written about it
afterwards. Sealed trials and answers stand one a line, so that a line is what changes. Beside the batches,
``missed.md`` says why the largest one missed some criteria.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skred.prove.scorecard import DIAGNOSIS
from skred.prove.scores_answers import Pair, pairs_of
from skred.work.output import plain, write_text

RECORD = Path(__file__).resolve().parent / "results" / "proof"
DIGITS = 6
"""Significant digits of what is kept of an answer; what is sealed is kept to the last, for its hash."""
LEFT_OUT = ("predictors", "identifiability", "detection_limits")
"""Not of the answer but of the campaign, which its seed draws again; most of the volume."""
Found = dict[str, Any]


def names() -> list[str]:
    """Names of all files of the record, such as ``36048904/ledger.json``."""
    return sorted(file.relative_to(RECORD).as_posix() for file in RECORD.rglob("*") if file.is_file())


def text_of(name: str) -> str:
    """What is in a file of the record; this and `names` alone know how the record is kept."""
    return (RECORD / name).read_text(encoding="utf-8")


def batches() -> list[Path]:
    """The folders of all batches, by seed."""
    seeds = {name.partition("/")[0] for name in names() if "/" in name}
    return [RECORD / seed for seed in sorted(seeds, key=int)]


def is_open(batch: Path) -> bool:
    """Whether a batch has been revealed; until then there is the ledger alone."""
    return f"{batch.name}/sealed.json" in names()


def opened_batches() -> list[Path]:
    """The folders of those that were revealed."""
    return [one for one in batches() if is_open(one)]


def ledger_of(batch: Path) -> Found:
    """What was published before the first diagnosis."""
    return dict(json.loads(text_of(f"{batch.name}/ledger.json")))


def sealed_of(batch: Path) -> dict[str, Found]:
    """What was sealed, by trial; each with its ``truth`` and its salt."""
    return dict(json.loads(text_of(f"{batch.name}/sealed.json")))


def answers_of(batch: Path) -> dict[str, dict[str, Found]]:
    """What each method answered, by trial."""
    folder = f"{batch.name}/answers/"
    found = [name for name in names() if name.startswith(folder)]
    return {name.removeprefix(folder).removesuffix(".json"): json.loads(text_of(name)) for name in found}


def notes_of(batch: Path) -> str:
    """What was written about a batch after it was opened or given up; empty where nothing was."""
    name = f"{batch.name}/notes.md"
    return text_of(name) if name in names() else ""


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
