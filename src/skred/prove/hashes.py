"""SHA-256 of what is sealed: plain data, folders, and the source that is running."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from skred.errors import InputError

PACKAGES = ("skred", "models")
SCORING = (
    "prove/scorecard.py",
    "prove/scoring/*.py",
    "report/scorecard/*.py",
    "report/templates/scorecard*.jinja",
)
"""Files that decide how answers are scored, within the package."""


def canonical(document: dict[str, Any]) -> bytes:
    """Plain data as bytes, the same whatever the order of its keys."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return text.encode("ascii")


def document_sha256(document: dict[str, Any]) -> str:
    """Hash of plain data."""
    return hashlib.sha256(canonical(document)).hexdigest()


def file_sha256(file: Path) -> str:
    """Hash of a file's bytes."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def files_sha256(folder: Path) -> dict[str, str]:
    """Hash of every file in a folder and below, by its path in it."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {file.relative_to(folder).as_posix(): file_sha256(file) for file in files}


def package_folder(name: str) -> Path:
    """Folder of an installed package."""
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        raise InputError(f"the package {name} is not installed")
    return Path(next(iter(spec.submodule_search_locations))).resolve()


def source_sha256() -> str:
    """Hash over the source and templates of the package and its laws, as installed."""
    files = []
    for name in PACKAGES:
        folder = package_folder(name)
        sources = (file for suffix in ("py", "jinja") for file in folder.rglob(f"*.{suffix}"))
        files += [(f"{name}/{file.relative_to(folder).as_posix()}", file) for file in sources]
    return _together(files)


def scorer_sha256() -> str:
    """Hash over the files that decide how answers are scored."""
    folder = package_folder("skred")
    files = (file for pattern in SCORING for file in folder.glob(pattern))
    return _together((file.relative_to(folder).as_posix(), file) for file in files)


def _together(files: Iterable[tuple[str, Path]]) -> str:
    """One hash over the names and the contents of files, whatever their order."""
    digest = hashlib.sha256()
    for name, file in sorted(files):
        digest.update(f"{name}\n{file_sha256(file)}\n".encode())
    return digest.hexdigest()
