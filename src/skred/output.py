"""Where results go: never over others without being told, never half written."""

from __future__ import annotations

import json
import math
import os
from datetime import datetime
from pathlib import Path
from typing import Any

from skred.errors import InputError


class OutputError(InputError):
    """The output folder cannot be used as asked."""


def output_folder(out: Path | None, command: str, *, force: bool) -> Path:
    """Make or take the folder for results.

    Parameters
    ----------
    out : Path or None
        A folder that does not exist or is empty; None for a new one under ``./skred-out``.
    command : str
        Part of the new folder's name.
    force : bool
        Take a folder that holds files; those that the command may write are replaced or removed.

    Raises
    ------
    OutputError
        If the folder holds files and `force` is not given, or is not a folder.
    """
    if out is None:
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
        return _fresh(Path("skred-out"), f"{command}-{stamp}")
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out}: expected a folder, found a file; choose another --out")
    if not force and out.is_dir() and any(out.iterdir()):
        raise OutputError(f"{out}: holds files already; choose another --out, or --force to replace them")
    out.mkdir(parents=True, exist_ok=True)
    return out


def _fresh(parent: Path, name: str) -> Path:
    """A folder of its own, also for two runs in one second."""
    parent.mkdir(parents=True, exist_ok=True)
    number = 1
    while True:
        folder = parent / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir()
        except FileExistsError:
            number += 1
            continue
        return folder


def write_text(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    partial = file.with_name(f".{file.name}.partial")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, file)


def write_json(file: Path, document: dict[str, Any]) -> None:
    """Write a JSON file whole or not at all; numbers that are not finite become null."""
    write_text(file, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Plain JSON types; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
