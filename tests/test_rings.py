"""Rings: imports only go inward, and the physics ring stands alone."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import skred

PACKAGE = Path(skred.__file__).resolve().parent
HEAVY = {"pytensor", "pymc", "arviz", "xarray", "pandas", "matplotlib"}
OUTSIDE = {
    "physics": {"campaign", "inference", "diagnosis", "trials", "prove", "report", "work", "cli"},
    "inference": {"diagnosis", "trials", "prove", "report", "work", "cli"},
    "campaign": {"inference", "diagnosis", "trials", "prove", "report", "work", "cli"},
    "diagnosis": {"trials", "prove", "report", "cli"},
    "trials": {"physics", "inference", "diagnosis", "prove", "report", "work", "cli"},
}
"""Rooms that a room must not import: the simulator none that what it tests is made of."""


def loaded_by(statement: str) -> set[str]:
    """Top-level modules that a fresh interpreter has loaded after a statement."""
    script = f"{statement}; import sys; print(*{{name.partition('.')[0] for name in sys.modules}})"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    return set(output.split())


def modules_of(room: str) -> list[Path]:
    return sorted((PACKAGE / room).rglob("*.py"))


def dotted(file: Path) -> str:
    return ".".join(("skred", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


def test_physics_loads_nothing_of_the_outer_rings() -> None:
    names = ", ".join(dotted(file) for file in modules_of("physics"))
    assert names.count(",") > 10
    assert not loaded_by(f"import {names}") & HEAVY


def test_importing_the_package_is_light() -> None:
    assert not loaded_by("import skred") & (HEAVY | {"numpy", "numba", "scipy"})


@pytest.mark.parametrize("room", OUTSIDE)
def test_imports_only_go_inward(room: str) -> None:
    assert modules_of(room)
    for file in modules_of(room):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}: relative import"
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            rooms = {name.split(".")[1] for name in names if name.startswith("skred.")}
            assert not rooms & OUTSIDE[room], f"{file}, line {node.lineno}: imports {rooms & OUTSIDE[room]}"
