"""Where compiled code is kept by a user who has no home, or cannot write there."""

from __future__ import annotations

import os
import stat
import tempfile
from functools import cache
from pathlib import Path


@cache
def private_temporary_folder() -> Path:
    """A temporary folder that this user alone can write: what is kept there is run as code.

    The same for all processes of a user; another each time where somebody else has taken its place.
    """
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "")
    folder = Path(tempfile.gettempdir()) / f"skred-{owner}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    owned = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    if not owned or not stat.S_ISDIR(found.st_mode) or found.st_mode & 0o022:
        return Path(tempfile.mkdtemp(prefix="skred-"))
    return folder


def let_pytensor_write() -> None:
    """Have PyTensor keep its compiled code in a temporary folder where it could not write in its own.

    It reads its settings when it is imported, and cannot be imported without such a folder.
    """
    flags = os.environ.get("PYTENSOR_FLAGS", "")
    if "compiledir" in flags or _can_write(Path(os.path.expanduser("~")) / ".pytensor"):
        return
    own = f"base_compiledir={private_temporary_folder() / 'pytensor'}"
    os.environ["PYTENSOR_FLAGS"] = f"{flags},{own}" if flags else own


def _can_write(folder: Path) -> bool:
    """Whether there is such a folder, made now if need be, that can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)
