"""A track's three files: all of them or none, and never over others without being told."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from skred.errors import InputError

_DOCUMENT = {"format", "skred", "profile"}
"""What every document of a track has; none of the files that a track is made from does."""


@contextmanager
def track_files(out: Path, *, force: bool = False) -> Iterator[Path]:
    """Write files into a hidden folder beside where they go, and move them there once all are written.

    Parameters
    ----------
    out : Path
        The table, whose name ends in .csv; the others have its name with another end. Folders are made.
    force : bool
        Replace files of an earlier track that are there.

    Yields
    ------
    Path
        The table's name in the hidden folder, which is gone afterwards in any case.

    Raises
    ------
    InputError
        If a file is there already, or the name is not one of a table.
    """
    targets = require_free(out, force=force)
    made = [one for one in out.parents if not one.exists()]
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        with TemporaryDirectory(prefix=f".{out.stem[:100]}-", dir=out.parent) as beside:
            yield Path(beside) / out.name
            for target in reversed(targets):  # the table last: where it is, all is
                os.replace(Path(beside) / target.name, target)
    except BaseException:
        with suppress(OSError):  # of these, those that are empty
            for folder in made:
                folder.rmdir()
        raise


def require_free(out: Path, *, force: bool = False) -> list[Path]:
    """The three files of a track, none of which may be there.

    Parameters
    ----------
    out : Path
        The table.
    force : bool
        They may be there, as files of an earlier track: a ``.json`` that is something else, such as the line
        that is read, stays.

    Returns
    -------
    list of Path
        Table, document and figure.

    Raises
    ------
    InputError
        If one is there already, or the name is not one of a table.
    """
    if out.suffix != ".csv":
        raise InputError(f"--out {out}: expected the name of a table, ending in .csv")
    targets = [out, out.with_suffix(".json"), out.with_suffix(".png")]
    for target in targets:
        if target.is_dir():
            raise InputError(f"{target}: a folder is where this file is to go; choose another --out")
        if target.exists() and not force:
            raise InputError(f"{target}: is there already; choose another --out, or --force to replace it")
    if targets[1].exists() and not _is_of_a_track(targets[1]):
        raise InputError(
            f"{targets[1]}: is not the document of a track, which would be written here; --force replaces "
            "nothing else: choose another --out, or move the file away"
        )
    return targets


def _is_of_a_track(file: Path) -> bool:
    """Whether a file is the document of a track, of any version."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and _DOCUMENT <= content.keys()


def track_table(document: Mapping[str, Any]) -> str:
    """The text of ``track.csv``.

    Parameters
    ----------
    document : mapping
        As `skred.tracks.build.make_track` returns it.
    """
    profile = document["profile"]
    rows = (f"{x!r},{z!r}\n" for x, z in zip(profile["x_m"], profile["z_m"], strict=True))
    return "x_m,z_m\n" + "".join(rows)
