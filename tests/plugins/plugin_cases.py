"""Packages of other people: laid out as an installer leaves them, and seen by a process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint, distributions
from pathlib import Path

from skred.physics.mechanisms.library import GROUP

SPEC = """
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import (
    Added, BoundTo, Direction, Group, Mechanism, Shape, Strength,
    along_the_track, everywhere, lacking, one_shape,
)
from skred.physics.mechanisms.stretches import along_a_stretch, split_stretch, stretches


def mechanism(id, name, symbol, bound_to=BoundTo.TRACK, **more):
    ways = dict(scale=0.1, reason="a guess", direction=along_the_track(Column.CONSTANT, everywhere))
    ways |= dict(shapes=one_shape, bound_to=bound_to, joins=lacking(id)) | more.pop("added", {})
    return Mechanism(
        id=id, title=f"the title of {id}", strength=Strength(name, symbol, "1", 0.1, "a guess"),
        equation=f"-{symbol}", signature="one of its own", reference="nobody (2020)",
        added=Added(**ways), **more,
    )
"""
"""What the modules below share: a mechanism in one line."""


def install(folder: Path, package: str, code: str, entries: Mapping[str, str], group: str = GROUP) -> None:
    """A package of one module, named as it is, with entry points from ids to names in the module."""
    module = package.replace("-", "_")
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    metadata = folder / f"{module}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{id_} = {module}:{name}" for id_, name in entries.items()]
    (metadata / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))


def entries_in(folder: Path, group: str = GROUP) -> list[EntryPoint]:
    """Entry points of the packages in a folder, by package and name."""
    found = [
        entry for one in distributions(path=[str(folder)]) for entry in one.entry_points.select(group=group)
    ]
    return sorted(found, key=lambda entry: (entry.dist.name if entry.dist else "", entry.name))


def seen(folder: Path, *words: str, timeout_s: float = 900.0) -> subprocess.CompletedProcess[str]:
    """A Python process that finds the packages in a folder."""
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        timeout=timeout_s,
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "80", "NO_COLOR": "1"},
        check=False,
    )


def skred(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The command line, in such a process."""
    return seen(folder, "-m", "skred.cli", *words)
