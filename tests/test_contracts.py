"""Rooms import only what they may, tests and studies only what is public; importing the package is light."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).resolve().parent.parent
CONFIGURATION = ROOT / "pyproject.toml"
FOLDERS = ("tests", "studies", "benchmarks")
"""What looks at the package from outside."""
PACKAGES = {"skred", "models"}
NAMED_TUPLE = {"_asdict", "_fields", "_make", "_replace"}
"""Public in spite of their underscore."""
PATCHES = {"setattr", "delattr", "getattr", "hasattr", "patch", "object"}
HEAVY = {"pytensor", "pymc", "arviz", "xarray", "pandas", "matplotlib", "numpy", "numba", "scipy"}


def test_contracts_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    """Those of ``[tool.importlinter]``: ``lint-imports`` says which is broken, and how."""
    code = lint_imports(config_filename=str(CONFIGURATION), no_cache=True)
    assert code == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_importing_the_package_is_light() -> None:
    script = "import skred, sys; print(*{name.partition('.')[0] for name in sys.modules})"
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert not set(output.split()) & HEAVY


def is_private(name: str) -> bool:
    """Whether any part of a dotted name is."""
    parts = name.split(".")
    return any(part.startswith("_") and not part.endswith("__") and part not in NAMED_TUPLE for part in parts)


def private_names(code: str) -> Iterator[str]:
    """Private names that code imports from the packages, reads from objects or patches; in strings too."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
            yield from filter(is_private, (f"{node.module}.{one.name}" for one in node.names))
        elif isinstance(node, ast.Import):
            names = [one.name for one in node.names if one.name.split(".")[0] in PACKAGES]
            yield from filter(is_private, names)
        elif isinstance(node, ast.Attribute) and is_private(node.attr):
            of = ast.unparse(node.value)
            if of not in ("self", "cls", "super()"):
                yield f"{of}.{node.attr}"
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in PATCHES:
            texts = [one.value for one in node.args[:2] if isinstance(one, ast.Constant)]
            yield from (text for text in texts[:1] if isinstance(text, str) and is_private(text))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "import " in node.value:
            try:  # what another process is given to run
                yield from list(private_names(node.value))
            except SyntaxError:
                continue


@pytest.mark.parametrize("folder", FOLDERS)
def test_what_looks_from_outside_uses_public_names(folder: str) -> None:
    """No import of a private name, and none patched: what is tested or measured has a name of its own."""
    files = {file: file.read_text(encoding="utf-8") for file in sorted((ROOT / folder).rglob("*.py"))}
    found = {str(file.relative_to(ROOT)): list(private_names(code)) for file, code in files.items()}
    assert {file: names for file, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "code",
    [
        "from skred.errors import PRIVATE",
        "from skred.PRIVATE import x",
        "import skred.PRIVATE",
        "def f():\n    from models.pcm import PRIVATE",
        "errors.PRIVATE",
        "problem.law.PRIVATE()",
        "monkeypatch.setattr(errors, 'PRIVATE', 1)",
        "monkeypatch.setattr('skred.errors.PRIVATE', 1)",
        "mock.patch('skred.errors.PRIVATE')",
        "patch.object(errors, 'PRIVATE', 1)",
        "getattr(errors, 'PRIVATE')",
        "run('from skred.errors import PRIVATE; print(PRIVATE)')",
    ],
)
def test_private_names_are_seen(code: str) -> None:
    assert list(private_names(code.replace("PRIVATE", "_x")))
    assert not list(private_names(code))


def test_public_names_are_not_taken_for_private_ones() -> None:
    code = """
from skred.errors import InputError as _error
from os import _exit
import skred.cli.__main__
rows._replace(values=rows._asdict())
self._x = errors.__doc__
monkeypatch.setattr("tempfile.tempdir", "_x/y")
"""
    assert list(private_names(code)) == []


def test_benchmarks_need_no_study() -> None:
    """Studies may use what is run again; what is run again does not rest on what was done once."""
    for file in (ROOT / "benchmarks").rglob("*.py"):
        imported = [
            name
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            for name in modules_of(node)
        ]
        assert not [name for name in imported if name.split(".")[0] == "studies"], file


def modules_of(node: ast.AST) -> list[str]:
    """Modules that a statement imports from."""
    match node:
        case ast.Import():
            return [one.name for one in node.names]
        case ast.ImportFrom():
            return [node.module or ""]
    return []
