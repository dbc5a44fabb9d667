"""Where results go: never over others without being told, never half written.

A run writes into a hidden folder inside of its results folder, and moves what it wrote into place once all of
it is there. It lies inside, not beside, because a results folder may be a file system of its own, such as a
folder that a container was given. A run that is ended half-way leaves the earlier results as they were.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from skred.errors import InputError

UNFINISHED = ".skred-unfinished"
"""Holds what a run has written so far."""
FINISHED = ".skred-finished"
"""Holds a whole run's results while they are moved into place."""
WRITTEN = ".skred-written.json"
"""Says which files of a folder are results of which command; all others are never removed."""
_HIDDEN = frozenset((UNFINISHED, FINISHED))
_BY_DEFAULT = Path("skred-out")


class OutputError(InputError):
    """The output folder cannot be used as asked."""


@dataclass(frozen=True)
class ResultsFolder:
    """Where the results of a run go.

    Attributes
    ----------
    path : Path
        Where they are once the run is done.
    unfinished : Path
        Where to write them until then.
    """

    path: Path
    unfinished: Path


@contextmanager
def results_folder(
    out: Path | None, command: str, *, force: bool = False, name: str | None = None
) -> Iterator[ResultsFolder]:
    """Write a run's results beside earlier ones, and put them in their place at the end.

    Where the run ends half-way, by an error or by Ctrl-C, the earlier results stay as they were and
    what it has written stays in `UNFINISHED`; `left_by` tells where. The next run removes that.

    Parameters
    ----------
    out : Path or None
        A folder that does not exist or is empty; None for a new one under ``./skred-out``.
    command : str
        What writes. Files that an earlier run of the same command wrote, and this one did not, are removed.
    force : bool
        Take a folder that holds files; those that are not results of `command` stay, except that results
        replace files of the same name.
    name : str, optional
        Part of the new folder's name; `command` by default.

    Raises
    ------
    OutputError
        If the folder holds files and `force` is not given, is not a folder, is in use by another run, or
        holds a folder where a file is to go.
    """
    made = _missing(out if out is not None else _BY_DEFAULT / "new")
    path = _place(out, name or command)
    with alone_in(path, "run"):
        _put_in_place(path)  # of a run that was killed while it did
        _require_free(path, force=force)
        unfinished = path / UNFINISHED
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
        try:
            yield ResultsFolder(path, unfinished)
            _finish(path, command)
        except BaseException as error:
            _leave(unfinished, error, [path, *made[1:]] if made else [])
            raise


def output_folder(out: Path | None, name: str) -> Path:
    """Make or take a folder for what is written bit by bit.

    Parameters
    ----------
    out : Path or None
        A folder that does not exist or is empty; None for a new one under ``./skred-out``.
    name : str
        Part of the new folder's name.

    Raises
    ------
    OutputError
        If the folder holds files or is not a folder.
    """
    path = _place(out, name)
    _require_free(path, force=False)
    return path


def left_by(error: BaseException) -> Path | None:
    """Folder with what a run had written when it ended by an error; None where there is nothing."""
    return vars(error).get("left_by_run")


def _leave(unfinished: Path, error: BaseException, made: Sequence[Path]) -> None:
    """Keep what is whole, and the folder itself where a traceback is to be written into it."""
    for half in unfinished.rglob(".*.partial"):
        half.unlink(missing_ok=True)
    is_fault = isinstance(error, Exception) and not isinstance(error, (InputError, OSError))
    if is_fault or any(one.is_file() for one in unfinished.rglob("*")):
        vars(error)["left_by_run"] = unfinished
        return
    shutil.rmtree(unfinished, ignore_errors=True)
    with suppress(OSError):  # of these, those that are empty
        for folder in made:
            folder.rmdir()


def _finish(path: Path, command: str) -> None:
    """Declare a run's results whole, and put them in their place."""
    unfinished = path / UNFINISHED
    files = sorted(str(one.relative_to(unfinished)) for one in unfinished.rglob("*") if one.is_file())
    for file in files:
        inner = [path / parent for parent in Path(file).parents if parent != Path()]
        if (path / file).is_dir() or any(one.exists() and not one.is_dir() for one in inner):
            raise OutputError(f"{path / file}: something else is where this file is to go; move it away")
    write_json(unfinished / WRITTEN, {command: files})
    os.rename(unfinished, path / FINISHED)
    _put_in_place(path)


def _put_in_place(path: Path) -> None:
    """Move whole results into place; where that is broken off, the next call goes on with it."""
    finished = path / FINISHED
    if not finished.is_dir():
        return
    before, now = _written(path), _written(finished)
    for command, files in now.items():
        for file in set(before.get(command, ())) - set(files):
            _remove(path, file)
        for file in files:
            if (finished / file).exists():
                (path / file).parent.mkdir(parents=True, exist_ok=True)
                os.replace(finished / file, path / file)
    write_json(path / WRITTEN, before | now)
    shutil.rmtree(finished)


def _written(folder: Path) -> dict[str, list[str]]:
    """Results in a folder, by command; nothing where that is not known."""
    try:
        known = json.loads((folder / WRITTEN).read_text(encoding="utf-8"))
        return {command: [str(file) for file in files] for command, files in known.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return {}


def _remove(path: Path, file: str) -> None:
    """Remove an earlier result and folders that are empty then; nothing outside of the results folder."""
    parent = (path / file).parent
    if not parent.resolve().is_relative_to(path.resolve()):
        return
    with suppress(OSError):  # it may be gone, and folders may hold what is not ours
        (path / file).unlink()
        while parent != path:
            parent.rmdir()
            parent = parent.parent


@contextmanager
def alone_in(folder: Path, who: str) -> Iterator[None]:
    """Refuse a second command at work in the same folder; the first one's claim ends with its process.

    Parameters
    ----------
    folder : Path
    who : str
        What works there, for the message.

    Raises
    ------
    OutputError
        If another process is at work there.
    """
    if sys.platform == "win32":
        yield
        return
    import fcntl

    claim = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(claim)
        raise OutputError(f"{folder}: another {who} is at work here; wait for it") from None
    except OSError:
        pass  # some network file systems know no locks
    try:
        yield
    finally:
        os.close(claim)


def _missing(path: Path) -> list[Path]:
    """Of a folder and those above it, the ones that are not there, innermost first."""
    return [one for one in (path, *path.parents) if not one.exists()]


def _place(out: Path | None, name: str) -> Path:
    """The folder that was asked for, made where it is not there; a new one where none was."""
    if out is None:
        return _fresh(_BY_DEFAULT, f"{name}-{datetime.now():%Y%m%d-%H%M%S}")
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out}: expected a folder, found a file; choose another --out")
    out.mkdir(parents=True, exist_ok=True)
    return out


def _require_free(path: Path, *, force: bool) -> None:
    """Refuse a folder that holds files, unless it is to be used all the same."""
    if not force and any(one.name not in _HIDDEN for one in path.iterdir()):
        raise OutputError(f"{path}: holds files already; choose another --out, or --force to replace them")


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


def write_bytes(file: Path, content: bytes | memoryview) -> None:
    """Write a file whole or not at all."""
    partial = file.with_name(f".{file.name}.partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, file)
    finally:  # where the disk is full, a half file would keep it so
        partial.unlink(missing_ok=True)


def write_text(file: Path, text: str) -> None:
    """Write a text file, in UTF-8, whole or not at all."""
    write_bytes(file, text.encode("utf-8"))


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
