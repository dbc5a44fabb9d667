"""Which mechanisms are let in one after the other, and what is kept of a comparison that let nothing in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from skred.diagnosis import diagnose
from skred.diagnosis.clock import Clock
from skred.diagnosis.compare.decision import Decision
from skred.diagnosis.diagnose import Effort, Left, add_mechanisms
from skred.inference.sampling import SamplerSettings

BASE: Any = SimpleNamespace(law=SimpleNamespace(id="pcm"), problem=None)
REFERENCES: Any = SimpleNamespace(begin=lambda problem: None)


def raced(**shares: float) -> Any:
    """A comparison with these probabilities."""
    candidates = {name: SimpleNamespace(best=name) for name in shares}
    under_errors = SimpleNamespace(base=BASE, candidates=candidates)
    return SimpleNamespace(probability=shares, leading=lambda name: under_errors)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs `let_in` with p-values of the checks, a second comparison, and which calibrations pass."""

    def once(p_values: list[float], second: Any, passed: tuple[bool, ...] = (True, True)) -> Any:
        gates = iter(passed)
        checks = iter(p_values)

        def calibrated(problem: Any, law: Any, settings: Any) -> Any:
            return SimpleNamespace(gate=SimpleNamespace(passed=next(gates), problems=("r-hat",)))

        def checked(*args: Any) -> Any:
            p_value = next(checks)
            return SimpleNamespace(p_value=p_value, fired=p_value <= 0.01), BASE

        monkeypatch.setattr(diagnose, "_plain", lambda base: base)
        monkeypatch.setattr(diagnose, "augmented_problem", lambda base, chosen: list(chosen))
        monkeypatch.setattr(diagnose, "calibrate_surely", calibrated)
        monkeypatch.setattr(diagnose, "_check_again", checked)
        monkeypatch.setattr(diagnose, "compare", lambda base: second)
        first, named = (
            raced(nothing=0.0, unlisted=0.0, obstacle=1.0),
            Decision("missing_physics", ("obstacle",)),
        )
        return add_mechanisms(
            BASE, first, named, REFERENCES, SamplerSettings(), Effort(), Clock(lambda line: None)
        )

    return once


def test_a_check_without_doubt_ends_it(run: Any) -> None:
    steps, cannot, left = run([0.3], raced(nothing=0.0, unlisted=0.0, segment_drag=1.0))
    assert len(steps) == 1 and not cannot and left == Left()


def test_in_doubt_the_race_has_to_be_sure(run: Any) -> None:
    sure = raced(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    steps, _, left = run([0.15, 0.5], sure)
    assert [step.candidate.best for step in steps] == ["obstacle", "segment_drag"] and left == Left()
    unsure = raced(nothing=0.3, unlisted=0.0, segment_drag=0.7)
    steps, _, left = run([0.15], unsure)
    assert len(steps) == 1 and left.comparison is unsure and not left.reason


def test_a_second_race_without_a_name_is_kept(run: Any) -> None:
    unlisted = raced(nothing=0.001, unlisted=0.999, segment_drag=0.0)
    steps, cannot, left = run([0.005], unlisted)
    assert len(steps) == 1 and not cannot and left.comparison is unlisted


def test_a_second_one_whose_gate_fails_is_told(run: Any) -> None:
    sure = raced(nothing=0.001, unlisted=0.0, segment_drag=0.999)
    steps, cannot, left = run([0.005], sure, (True, False))
    assert len(steps) == 1 and not cannot and left.comparison is sure and "r-hat" in left.reason
    steps, cannot, left = run([], sure, (False,))
    assert steps == () and "r-hat" in cannot and left == Left()
