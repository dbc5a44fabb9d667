"""`skred mechanisms`: the library in a table, one mechanism in full, and what is not there."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from skred.cli.main import run
from skred.physics.laws import law_ids, load_law
from skred.physics.mechanisms import mechanisms
from skred.report.mechanisms import mechanism_document

ALL = mechanisms()
COLUMNS = 80
UNITS = {"1": "-", "m": "m", "m-1": "1/m", "s-1": "1/s", "m s-2": "m/s²"}
"""As people read them."""


@pytest.fixture(autouse=True)
def narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    monkeypatch.setenv("NO_COLOR", "1")


def document(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    assert run(["mechanisms", *words, "--json"]) == 0
    told = capsys.readouterr()
    assert told.err == ""
    found: dict[str, object] = json.loads(told.out)
    return found


def test_all_in_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mechanisms"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for mechanism in ALL.values():
        (row,) = (line for line in lines if line.startswith(f"{mechanism.id} "))
        strength, added = mechanism.strength, mechanism.added
        assert added is not None
        assert f"{strength.symbol} [{UNITS[strength.unit]}]" in row and f" {added.scale:g} " in row
        assert ("±" in row) is added.either_sign and str(mechanism.group) in row
    assert max(map(len, lines)) <= COLUMNS


def test_nothing_is_cut_off(capsys: pytest.CaptureFixture[str]) -> None:
    """A table too wide loses its last column without a word."""
    assert run(["mechanisms"]) == 0
    words = capsys.readouterr().out.replace(",", " ").split()
    assert {"voellmy", "pcm", "coulomb", "constant", "laws"} <= set(words)
    assert words[-3:] == ["skred", "mechanisms", "ID."]


@pytest.mark.parametrize("mechanism_id", ALL)
def test_one_in_full(mechanism_id: str, capsys: pytest.CaptureFixture[str]) -> None:
    mechanism = ALL[mechanism_id]
    assert run(["mechanisms", mechanism_id]) == 0
    out = capsys.readouterr().out
    flat = " ".join(out.split())
    added = mechanism.added
    assert added is not None
    for text in (mechanism.title, mechanism.equation, mechanism.signature, mechanism.reference, added.reason):
        assert text in flat
    assert f"https://doi.org/{mechanism.doi}" in out and mechanism.strength.name in out
    assert ("sign either" in flat) is added.either_sign
    assert f"unit {UNITS[mechanism.strength.unit]} sign" in flat and " m s-" not in flat


def test_shapes_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    looked_for = {name: str(document(capsys, name)["looked_for"]) for name in ALL}
    assert looked_for["segment_drag"].startswith("stretches of 75, 200 or 500 m")
    assert looked_for["obstacle"].startswith("stretches of 50 m")
    assert looked_for["obstacle"].endswith("; with loss [m-1] of 0.006 or 0.025, or with J/gh [1] of 1")
    assert looked_for["entrainment"].endswith("; also with m_2/m_1 [1] of 2")
    along_the_track = "the whole track, or from the first recording on"
    assert looked_for["velocity_weakening"] == f"{along_the_track}; U_c [m s-1] of 4, 8 or 15"
    assert looked_for["turbulent_drag"] == along_the_track
    assert looked_for["centrifugal"] == "the whole track"
    assert "sensor" in looked_for["sensor_bias"] and "covariate" in looked_for["covariate_friction"]
    assert looked_for["release_offset"] == "all avalanches alike"


def test_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    listed = document(capsys)["mechanisms"]
    assert isinstance(listed, list)
    assert [one["id"] for one in listed] == sorted(ALL)
    for one in listed:
        assert one == document(capsys, one["id"])


def test_where_they_can_be_missing() -> None:
    laws = [load_law(name) for name in law_ids()]
    missing = {name: mechanism_document(one, laws)["missing_from"] for name, one in ALL.items()}
    assert missing["centrifugal"] == ["voellmy"]
    assert missing["coulomb_friction"] == ["constant"]
    assert missing["turbulent_drag"] == ["constant", "coulomb"]
    assert missing["constant_retardation"] == ["coulomb", "pcm", "voellmy"]
    assert missing["obstacle"] == law_ids()


def test_the_same_term_is_told_of_both() -> None:
    ties = {name: mechanism_document(one, [])["same_term"] for name, one in ALL.items()}
    assert ties["segment_drag"] == ["entrainment"] and ties["entrainment"] == ["segment_drag"]
    assert sum(map(len, ties.values())) == 2


@pytest.mark.parametrize("name", ["dam", "", "Obstacle", "nothing", "\x1b[31m[red]"])
def test_an_unknown_one(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mechanisms", name]) == 2
    told = capsys.readouterr()
    assert told.out == "" and "\x1b" not in told.err
    assert repr(name) in told.err and all(known in told.err for known in ALL)


def test_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mechanisms", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["mechanisms", "identify", "diagnose"])
def test_help_needs_no_heavy_imports(command: str) -> None:
    code = (
        "import sys; from skred.cli.main import run; code = run(sys.argv[1:]); "
        "heavy = {'numpy', 'pandas', 'pydantic', 'pymc', 'numba', 'scipy'} & set(sys.modules); "
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, command, "--help"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Usage" in done.stdout


def test_the_list_needs_no_heavy_imports() -> None:
    code = (
        "import sys; from skred.cli.main import run; run(['mechanisms', '--quiet']); "
        "print({'pymc', 'numba', 'xarray', 'pandas', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.strip() == "set()"
