"""The page of thresholds: it is what the source says, and every number has a reason."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT, METHOD = ROOT / "scripts" / "thresholds.py", ROOT / "docs" / "method.md"
MODULE = '''"""A module."""

import math

# How far off
# a reading may be.
FAR = 4.0

NEAR_M, WIDE_M = 8.0, 2 * 8.0
"""Two lengths,
one of them wide."""
SHARES = {"one": 0.5, "other": 0.5}  # of equal probability
_SAMPLED = Budget(32, linear=True)
"""Nats of ``this`` | that."""
_PAIRS = (("first", 1), ("second", 2))
ROOT_2 = math.sqrt(2.0)
HALF = 0.5 * ROOT_2
FIRST, SECOND = range(2)
KEY = int(NAME[:12], 16)
lower = 3.0


def function():
    INSIDE = 3.0
    return INSIDE


LEFT = 3
RIGHT = FAR * 0.5
"""Half as far."""
'''


@pytest.fixture(scope="module")
def script() -> SimpleNamespace:
    """The script, which is in no package."""
    return SimpleNamespace(**runpy.run_path(str(SCRIPT)))


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of one module and of one more below."""
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "module.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "room" / "inner").mkdir()
    (tmp_path / "room" / "inner" / "__init__.py").write_text("DEEP = 1\n", encoding="utf-8")
    return tmp_path


def test_every_threshold_has_a_reason(script: SimpleNamespace) -> None:
    assert script.unexplained(script.all_constants()) == []


def test_page_is_what_the_source_says(script: SimpleNamespace) -> None:
    assert script.PAGE.read_text(encoding="utf-8") == script.page(script.all_constants())


def numbers(text: str) -> list[float]:
    """All numbers in a text that are not part of a name."""
    return [float(one) for one in re.findall(r"(?<![\w.])\d+(?:\.\d+)?", text)]


def test_limits_on_the_page_of_the_method_are_those_of_the_source(script: SimpleNamespace) -> None:
    values: dict[str, list[float]] = {}
    for one in script.all_constants():
        found = numbers(one.value)
        each = len(one.names) > 1 and len(found) == len(one.names)
        values |= {name: [found[k]] if each else found for k, name in enumerate(one.names)}
    rows = re.findall(
        r"^\| (`[A-Z_]+`(?:, `[A-Z_]+`)*) \| ([^|]*) \|", METHOD.read_text(encoding="utf-8"), re.M
    )
    assert len(rows) >= 7
    for names, shown in rows:
        expected = [value for name in re.findall(r"[A-Z_]+", names) for value in values[name]]
        assert numbers(shown) == expected, names


def test_numbers_are_found_with_their_reasons(script: SimpleNamespace, package: Path) -> None:
    found = script.all_constants(package, ("room",))
    reasons = {one.names: one.reason for one in found}
    assert reasons == {
        ("DEEP",): "",
        ("FAR",): "How far off a reading may be.",
        ("NEAR_M", "WIDE_M"): "Two lengths, one of them wide.",
        ("SHARES",): "of equal probability",
        ("_SAMPLED",): "Nats of ``this`` | that.",
        ("LEFT",): "",
        ("RIGHT",): "Half as far.",
    }
    assert {one.names: one.unit for one in found if one.unit} == {
        ("NEAR_M", "WIDE_M"): "m",
        ("_SAMPLED",): "nats",
    }
    assert found[2].value == "8.0, 2 * 8.0"
    assert [one.module.removeprefix(package.name) for one in found[:2]] == [".room.inner", ".room.module"]


def test_rows_are_rows_of_a_table(script: SimpleNamespace, package: Path) -> None:
    rows = [one.row for one in script.all_constants(package, ("room",))]
    assert all(row.replace("\\|", "").count("|") == 6 for row in rows)


def test_what_has_no_reason_is_listed(script: SimpleNamespace, package: Path) -> None:
    missing = script.unexplained(script.all_constants(package, ("room",)))
    assert [one.rpartition(".room.")[2] for one in missing] == ["inner:1: DEEP = 1", "module:28: LEFT = 3"]


def test_counts_by_package(script: SimpleNamespace, package: Path) -> None:
    (package / "beside.py").write_text('"""Text."""\n\n# Comment.\nx = 1  # code\n', encoding="utf-8")
    rows = [row.split(" | ") for row in script.counts(package).splitlines()]
    # Code: an import, 12 assignments, a function of 3 lines, and 1 assignment in the package below.
    assert rows[2] == ["| room", "2", "31", "17", "8 |"]
    assert rows[3] == ["| (beside them)", "1", "4", "1", "0 |"]
    assert rows[4] == ["| all", "3", "35", "18", "8 |"]
