"""Terminals that cannot write every character are told what they can."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys

import pytest

from skred.cli.terminal import write_what_it_can

ASCII = [
    {"PYTHONIOENCODING": "ascii"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"PYTHONIOENCODING": "latin-1"},
]


def written(text: str, encoding: str) -> str:
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding, errors="strict")
    write_what_it_can(stream)
    stream.write(text)
    stream.flush()
    return raw.getvalue().decode(encoding)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("310 ± 42 m²/s²", "310 +- 42 m2/s2"),
        ("Mærdalen, Málaga → 1–2 °", "M?rdalen, Malaga -> 1-2 deg"),
        ("雪崩", "??"),
        ("\udcff", "?"),
    ],
)
def test_the_nearest_that_a_terminal_has(text: str, plain: str) -> None:
    assert written(text, "ascii") == plain


def test_what_a_terminal_can_write_stays() -> None:
    assert written("± m² 雪", "utf-8") == "± m² 雪"
    assert written("± m² 雪", "latin-1") == "± m² ?"
    assert written("a\udcff", "utf-8") == "a?"


@pytest.mark.slow
@pytest.mark.parametrize("environment", ASCII, ids=lambda environment: " ".join(environment.values()))
@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["validate", "ryggfonn"], ["mechanisms"], ["mechanisms", "obstacle"], ["mechanisms", "é"]],
    ids=" ".join,
)
def test_commands_on_such_terminals(environment: dict[str, str], arguments: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "skred.cli", *arguments],
        capture_output=True,
        env={**os.environ, **environment},
        timeout=120,
        check=False,
    )
    assert done.returncode == (2 if arguments[-1] == "é" else 0), done.stderr
    assert b"Traceback" not in done.stderr and (done.stdout or done.stderr)
    if environment.get("PYTHONIOENCODING") != "latin-1":
        assert done.stdout.isascii() and done.stderr.isascii()


def test_json_is_the_same_everywhere() -> None:
    told = [
        subprocess.run(
            [sys.executable, "-m", "skred.cli", "mechanisms", "obstacle", "--json"],
            capture_output=True,
            env={**os.environ, **environment},
            timeout=120,
            check=True,
        ).stdout
        for environment in ({"PYTHONIOENCODING": "utf-8"}, ASCII[0])
    ]
    assert told[0] == told[1] and told[0].isascii() and json.loads(told[0])["id"] == "obstacle"
