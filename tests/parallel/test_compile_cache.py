"""Compiled code is cached under what it is made of: never stale, and never compiled for a sentence."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skred
from skred.parallel.compile_cache import compiled, inner
from skred.parallel.folders import private_temporary_folder

PACKAGE = Path(skred.__file__).resolve().parent
CALLEE = '''
"""A module."""
from skred.parallel.compile_cache import inner

FACTOR = 2.0

@inner()
def times(x):
    """Twice."""
    return FACTOR * x
'''
CALLER = '''
from callee import times
from skred.parallel.compile_cache import compiled

@compiled()
def at(x):
    """What comes of it."""
    return times(x) + 1.0

if __name__ == "__main__":
    found = at(3.0)
    print(found, sum(at.stats.cache_misses.values()), sum(times.stats.cache_misses.values()))
'''
NO_HOME = "/proc/no-home"


def run(folder: Path, *words: str, **environment: str) -> list[str]:
    """What a Python process prints, last line, in words."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), **environment}
    environment = {key: value for key, value in environment.items() if value}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1].split()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two modules, one of which calls the other; compiled once."""
    (tmp_path / "callee.py").write_text(CALLEE)
    (tmp_path / "caller.py").write_text(CALLER)
    assert run(tmp_path, "caller.py") == ["7.0", "1", "1"]
    assert run(tmp_path, "caller.py") == ["7.0", "0", "0"]
    return tmp_path


@pytest.mark.parametrize(
    ("before", "after", "value"),
    [("return FACTOR * x", "return FACTOR + x", "6.0"), ("FACTOR = 2.0", "FACTOR = 4.0", "13.0")],
)
def test_a_change_in_another_file_is_compiled(folder: Path, before: str, after: str, value: str) -> None:
    """Numba's own stamp is that of the caller's file alone: old machine code would run on."""
    (folder / "callee.py").write_text(CALLEE.replace(before, after))
    assert run(folder, "caller.py") == [value, "1", "1"]


@pytest.mark.slow
def test_an_option_is_part_of_the_stamp(folder: Path) -> None:
    (folder / "callee.py").write_text(CALLEE.replace("@inner()", '@inner(fastmath={"contract"})'))
    assert run(folder, "caller.py") == ["7.0", "1", "1"]


def test_a_changed_sentence_compiles_nothing(folder: Path) -> None:
    for name, text in (("callee", CALLEE), ("caller", CALLER)):
        text = text.replace("Twice.", "The double.\n\n    At greater length.\n    ").replace(
            "comes", "becomes"
        )
        (folder / f"{name}.py").write_text(
            "# A comment.\n\n" + text.replace("    return", "    # So.\n    return")
        )
    assert run(folder, "caller.py") == ["7.0", "0", "0"]


@pytest.mark.slow
def test_other_functions_are_cached_as_numba_does(folder: Path) -> None:
    """The setting that leads numba to our stamps holds for our functions alone."""
    (folder / "other.py").write_text(
        "import caller, numba\n"
        "from numba.core.caching import CacheImpl\n"
        "@numba.njit(cache=True)\n"
        "def f(x):\n    return x\n"
        "f(1)\n"
        "print(numba.config.CACHE_LOCATOR_CLASSES or 'unset', sum(f.stats.cache_misses.values()))\n"
    )
    assert run(folder, "other.py") == ["unset", "1"]


def test_a_read_only_install_without_a_home(tmp_path: Path) -> None:
    """Compiled once, and kept in a folder of this user's among the temporary ones."""
    shutil.copytree(PACKAGE, tmp_path / "skred", ignore=shutil.ignore_patterns("__pycache__"))
    for inside in [tmp_path / "skred", *(tmp_path / "skred").rglob("*/")]:
        (inside / "__pycache__").touch()  # no folder of that name can be made, not even by root
    (tmp_path / "temporary").mkdir()
    program = (
        "import numpy as np, skred, pytensor.link.numba.cache\n"
        "from skred.physics.kernel.inputs import make_contributions as f\n"
        "f(np.array([3]), np.ones((1, 2)), 1.0)\n"
        "print(skred.__file__, pytensor.config.base_compiledir, sum(f.stats.cache_misses.values()))"
    )
    bare = {"HOME": NO_HOME, "XDG_CACHE_HOME": "", "NUMBA_CACHE_DIR": "", "PYTENSOR_FLAGS": ""}
    bare |= {"TMPDIR": str(tmp_path / "temporary"), "PYTHONPATH": str(tmp_path)}
    for misses in "10":
        used, compiled_in, missed = run(tmp_path, "-B", "-c", program, **bare)
        assert Path(used).is_relative_to(tmp_path)
        assert Path(compiled_in).is_relative_to(tmp_path / "temporary")
        assert missed == misses


def test_a_temporary_folder_that_others_can_write_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is kept there is run."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    private_temporary_folder.cache_clear()
    usual = private_temporary_folder()
    assert usual.parent == tmp_path and usual.stat().st_mode & 0o077 == 0
    usual.chmod(0o777)
    private_temporary_folder.cache_clear()
    assert private_temporary_folder() != usual
    private_temporary_folder.cache_clear()


def _below(x: float) -> float:
    return x


def test_what_cannot_be_stamped_is_refused() -> None:
    """A function that is not compiled here may change unseen."""
    with pytest.raises(TypeError, match="_below"):

        @compiled()
        def at(x):  # type: ignore[no-untyped-def]
            return _below(x)

    with pytest.raises(TypeError, match="not_there"):

        @inner()
        def before(x):  # type: ignore[no-untyped-def]
            return not_there(x)  # type: ignore[name-defined]  # noqa: F821


def _decorators(node: ast.FunctionDef) -> set[str]:
    return {ast.unparse(one).partition("(")[0] for one in node.decorator_list}


def _functions(tree: ast.Module) -> list[ast.FunctionDef]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]


def test_python_calls_no_inner_function() -> None:
    """Such a call would end the process: there is no way in from Python."""
    trees = {file: ast.parse(file.read_text(encoding="utf-8")) for file in PACKAGE.rglob("*.py")}
    names = {
        ".".join(("skred", *file.relative_to(PACKAGE).with_suffix("").parts)): {
            node.name for node in _functions(tree) if "inner" in _decorators(node)
        }
        for file, tree in trees.items()
    }
    assert sum(map(len, names.values())) > 50
    for file, tree in trees.items():
        known = set(names[".".join(("skred", *file.relative_to(PACKAGE).with_suffix("").parts))])
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module in names:
                known |= {one.name for one in node.names} & names[node.module]
        compiled_there = {"_run_chain"}  # by a call of the decorator
        inside = {
            id(part)
            for node in _functions(tree)
            if _decorators(node) & {"inner", "compiled", "numba_njit"} or node.name in compiled_there
            for part in ast.walk(node)
        }
        called = {
            node.id
            for node in ast.walk(tree)
            if isinstance(node, ast.Name) and id(node) not in inside and node.id in known
        }
        assert not called, (file, called)


def test_every_compiled_function_goes_by_our_own_way() -> None:
    """None by numba's own decorator, which would be cached under its own file's content."""
    for file in set(PACKAGE.rglob("*.py")) - {PACKAGE / "parallel" / "compile_cache.py"}:
        text = file.read_text(encoding="utf-8").replace("numba_njit", "")
        assert "njit(" not in text and "import njit" not in text, file
