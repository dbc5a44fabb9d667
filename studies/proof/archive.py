"""Files in one compressed archive: read without being unpacked to disk, written whole or not at all.

The same files always make the same archive: members stand in the order of their names, without times and
owners.
"""

from __future__ import annotations

import io
import lzma
import os
import re
import tarfile
from collections.abc import Mapping
from pathlib import Path

MOST_BYTES = 64 * 2**20
"""What an archive may unpack to, at most."""
_NAME = re.compile(r"[0-9]+(/[a-z_]+)*/[a-z_]+\.json")
_PRESET = 9 | lzma.PRESET_EXTREME


class ArchiveError(ValueError):
    """An archive is too large, or holds what does not belong there."""


def read_archive(file: Path) -> dict[str, bytes]:
    """All files of an archive by name.

    Parameters
    ----------
    file : Path
        Such as `write_archive` makes.

    Raises
    ------
    ArchiveError
        If it unpacks to more than `MOST_BYTES`, or holds anything but plain files with names as expected.
    """
    unpacker = lzma.LZMADecompressor(format=lzma.FORMAT_XZ)
    unpacked = unpacker.decompress(file.read_bytes(), MOST_BYTES + 1)
    if len(unpacked) > MOST_BYTES or not unpacker.eof:
        raise ArchiveError(f"{file}: unpacks to more than {MOST_BYTES} bytes, or was cut off")
    found: dict[str, bytes] = {}
    with tarfile.open(fileobj=io.BytesIO(unpacked), mode="r:") as archive:
        for member in archive:
            stream = archive.extractfile(member) if member.isreg() else None
            if stream is None or not _NAME.fullmatch(member.name) or member.name in found:
                raise ArchiveError(f"{file}: {member.name[:80]!r} does not belong in it")
            found[member.name] = stream.read()
    return found


def write_archive(file: Path, files: Mapping[str, bytes]) -> None:
    """Write an archive, in place of another one if there is one.

    Raises
    ------
    ArchiveError
        If a name is not as expected.
    """
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:", format=tarfile.USTAR_FORMAT) as archive:
        for name, content in sorted(files.items()):
            if not _NAME.fullmatch(name):
                raise ArchiveError(f"{name[:80]!r} does not belong in {file}")
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    partial = file.with_name(f".{file.name}.partial")
    partial.write_bytes(lzma.compress(buffer.getvalue(), preset=_PRESET))
    os.replace(partial, file)
