"""Every program of benchmarks and studies says what it does; their results stay small."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOST_BYTES = 6 * 2**20
START = 'if __name__ == "__main__":'
ASK_EACH = """
import contextlib, io, json, runpy, sys

said = {}
for name in sys.argv[1:]:
    sys.argv, out = [name, "--help"], io.StringIO()
    try:
        with contextlib.redirect_stdout(out):
            runpy.run_module(name, run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = end.code or 0
    except Exception as error:
        code = repr(error)
    said[name] = [code, out.getvalue()]
print(json.dumps(said))
"""


def name_of(file: Path) -> str:
    """What to run a file by."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")


PROGRAMS = sorted(
    name_of(file)
    for folder in ("benchmarks", "studies")
    for file in (ROOT / folder).rglob("*.py")
    if START in file.read_text(encoding="utf-8")
)


@cache
def answers() -> dict[str, tuple[int | str, str]]:
    """Exit code and help of each program; all in one process, since all import the same packages."""
    command = [sys.executable, "-W", "ignore", "-c", ASK_EACH, *PROGRAMS]
    ended = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return dict(json.loads(ended.stdout.splitlines()[-1]))


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_says_what_it_does(program: str) -> None:
    code, said = answers()[program]
    assert code == 0
    assert "--help" in said or "usage" in said.lower()


def test_results_take_6_mb_at_most() -> None:
    listed = ["git", "ls-files", "-z", "--", "benchmarks/results", "studies/results"]
    ended = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True)
    if ended.returncode:
        pytest.skip("not a checkout")
    files = [ROOT / name for name in ended.stdout.split("\0") if name]
    assert len(files) > 10
    assert sum(file.stat().st_size for file in files if file.exists()) <= MOST_BYTES


@pytest.mark.parametrize("figure", sorted((ROOT / "docs" / "figures").glob("*.png")), ids=lambda f: f.name)
def test_a_figure_is_on_a_page(figure: Path) -> None:
    pages = [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"]
    assert any(f"figures/{figure.name}" in page.read_text(encoding="utf-8") for page in pages)
