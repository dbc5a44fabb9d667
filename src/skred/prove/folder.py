"""The folder of a proof: what lies where, and reading and writing it safely.

====================================  ===================================================================
``ledger.json``                       published before the first diagnosis: settings and hashes
``trials/trial-0001/campaign/``       what a diagnosis sees
``trials/trial-0001/request.json``    and the law it is asked about
``sealed/trial-0001.json``            salt, truth and hashes
``sealed/trial-0001-fresh/``          avalanches to predict that nobody has seen, where there are any
``answers/skred/trial-0001.json``     one answer a trial; those of other methods in folders beside
``scorecard.json``                    what came out, once it is opened
====================================  ===================================================================
"""

from __future__ import annotations

import json
import os
import re
import uuid
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.output import plain

METHOD = "skred"
"""Folder of the answers of the diagnosis itself."""
MOST_BYTES = 50_000_000
"""No file of a proof is larger."""
TRIAL_NAME = re.compile(r"trial-[0-9]{4,9}")


@dataclass(frozen=True)
class ProofFolder:
    """Paths of a proof.

    Attributes
    ----------
    path : Path
    """

    path: Path

    @property
    def ledger(self) -> Path:
        """Published hashes."""
        return self.path / "ledger.json"

    @property
    def plan(self) -> Path:
        """What is being sealed, until the ledger is there."""
        return self.path / "sealing.json"

    @property
    def scorecard(self) -> Path:
        """Scores; where this is, the trials are opened."""
        return self.path / "scorecard.json"

    def trial(self, name: str) -> Path:
        """Folder of a trial."""
        return self.path / "trials" / name

    def campaign(self, name: str) -> Path:
        """Folder of what a diagnosis sees."""
        return self.trial(name) / "campaign"

    def request(self, name: str) -> Path:
        """Which law a diagnosis is asked about."""
        return self.trial(name) / "request.json"

    def sealed(self, name: str) -> Path:
        """The truth."""
        return self.path / "sealed" / f"{name}.json"

    def fresh(self, name: str) -> Path:
        """Folder of the avalanches to predict."""
        return self.path / "sealed" / f"{name}-fresh"

    def answer(self, name: str, method: str = METHOD) -> Path:
        """Answer of a method."""
        return self.path / "answers" / method / f"{name}.json"

    def methods(self) -> list[str]:
        """Methods that have answered, sorted."""
        answers = self.path / "answers"
        return sorted(one.name for one in answers.iterdir() if one.is_dir()) if answers.is_dir() else []


def trial_name(number: int) -> str:
    """Name of a trial; the first has number 1."""
    return f"trial-{number:04d}"


def read_object(file: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises
    ------
    InputError
        If the file is not there, too large or something else.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file}: larger than {MOST_BYTES} bytes; not a file of a proof")
        document = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{file}: not there") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file}: expected JSON, found something else") from error
    if not isinstance(document, dict):
        raise InputError(f"{file}: expected a JSON object, found something else")
    return document


def write_once(file: Path, document: dict[str, Any], indent: int | None = 1) -> bool:
    """Write a JSON file whole, and only if it is not there; whether it was written.

    The file appears in one step, also where two try at once or the machine is stopped in between.
    """
    if file.exists():
        return False
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.{uuid.uuid4().hex}")
    text = json.dumps(plain(document), indent=indent, allow_nan=False) + "\n"
    try:
        with partial.open("w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.link(partial, file)
    except FileExistsError:
        return False
    finally:
        with suppress(FileNotFoundError):
            partial.unlink()
    return True
