"""Compiled code is cached under all the source that it may be made of."""

from __future__ import annotations

import inspect
import shutil
from pathlib import Path
from typing import Any

import pytest
from numba.core.caching import CacheImpl

import skred
from skred.diagnosis.augment.tabulated_op import tabulated_log_density
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.parallel.compile_cache import stamp_of
from skred.physics.kernel.fronts import simulate
from skred.simulator.march import fronts

PACKAGE = Path(skred.__file__).resolve().parent
ROOMS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "physics": (simulate, ()),
    "inference": (integrated_log_density, ("physics",)),
    "diagnosis": (tabulated_log_density, ("inference",)),
    "trials": (fronts, ()),
}
"""A compiled function of each room, and the rooms whose compiled functions it calls."""


def stamp(room: str, folders: dict[str, Path]) -> str:
    return stamp_of(folders[room], *(stamp(inner, folders) for inner in ROOMS[room][1]))


@pytest.mark.parametrize("room", ROOMS)
def test_numba_keeps_a_function_under_the_stamp_of_its_room(room: str) -> None:
    function = ROOMS[room][0].py_func
    file = inspect.getsourcefile(function)
    locators = (kind.from_function(function, file) for kind in CacheImpl._locator_classes)
    chosen = next(locator for locator in locators if locator is not None)
    assert chosen.get_source_stamp() == stamp(room, {name: PACKAGE / name for name in ROOMS})


@pytest.mark.parametrize("room", ["inference", "diagnosis"])
def test_a_change_in_what_a_room_calls_changes_its_stamp(tmp_path: Path, room: str) -> None:
    """Numba stamps a function with its own file only: old machine code of a callee would run on."""
    folders = {name: tmp_path / name for name in ROOMS}
    for name, folder in folders.items():
        shutil.copytree(PACKAGE / name, folder, ignore=shutil.ignore_patterns("__pycache__"))
    before = stamp(room, folders)
    assert before == stamp(room, {name: PACKAGE / name for name in ROOMS})
    with open(folders["physics"] / "cell.py", "a") as callee:
        callee.write("# changed\n")
    assert stamp(room, folders) != before


def test_every_compiled_function_goes_by_the_rooms_own_way() -> None:
    """None by numba's own decorator, which would be cached under its own file's content."""
    ours = {PACKAGE / "compiled.py", PACKAGE / "trials" / "compiled.py"}
    for file in set(PACKAGE.rglob("*.py")) - ours:
        assert "njit(" not in file.read_text(encoding="utf-8").replace("numba_njit", ""), file
