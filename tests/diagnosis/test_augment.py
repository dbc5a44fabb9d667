"""Which mechanisms are added one after the other, and what is kept of a comparison that added nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from skred.diagnosis.augment import add
from skred.diagnosis.augment.step import Augmented, NotAugmented
from skred.diagnosis.clock import Clock
from skred.diagnosis.effort import Effort, Run
from skred.inference.sampling import SamplerSettings

BASE: Any = SimpleNamespace(law=SimpleNamespace(id="pcm"), problem=None, plain=lambda: None)


def compared(**shares: float) -> Any:
    """A comparison with these probabilities."""
    candidates = {name: SimpleNamespace(best=name) for name in shares}
    under_errors = SimpleNamespace(base=BASE, candidates=candidates)
    return SimpleNamespace(probability=shares, leading=lambda name: under_errors)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Adds with p-values of the checks, a second comparison, and which calibrations converge."""

    def once(
        p_values: list[float], second: Any, passed: tuple[bool, ...] = (True, True), same_errors: str = ""
    ) -> Augmented | NotAugmented:
        gates, checks = iter(passed), iter(p_values)

        def calibrated(problem: Any, law: Any, settings: Any) -> Any:
            return SimpleNamespace(gate=SimpleNamespace(passed=next(gates), problems=("r-hat",)))

        def checked(*args: Any) -> Any:
            p_value = next(checks)
            return SimpleNamespace(p_value=p_value, fired=p_value <= 0.01), BASE

        monkeypatch.setattr(add, "augmented_problem", lambda base, chosen: list(chosen))
        monkeypatch.setattr(add, "calibrate_surely", calibrated)
        monkeypatch.setattr(add, "check_again", checked)
        monkeypatch.setattr(add, "compare", lambda base: second)
        reference: Any = SimpleNamespace(begin=lambda problem: None, on=lambda problem: ("base", same_errors))
        first = compared(nothing=0.0, unlisted=0.0, obstacle=1.0)
        doing = Run(SamplerSettings(), Effort(), Clock(lambda line: None))
        return add.add_mechanisms(BASE, first, ("obstacle",), reference, doing)

    return once


def test_a_check_without_doubt_ends_it(run: Any) -> None:
    found = run([0.3], compared(nothing=0.0, unlisted=0.0, segment_drag=1.0))
    assert len(found.steps) == 1 and found.reference == "base" and found.left is None


def test_in_doubt_the_comparison_has_to_be_sure(run: Any) -> None:
    sure = compared(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    found = run([0.15, 0.5], sure)
    assert [step.candidate.best for step in found.steps] == ["obstacle", "segment_drag"]
    assert found.left is None
    unsure = compared(nothing=0.3, unlisted=0.0, segment_drag=0.7)
    found = run([0.15], unsure)
    assert len(found.steps) == 1 and found.left.comparison is unsure and not found.left.reason


def test_a_second_comparison_without_a_name_is_kept(run: Any) -> None:
    unlisted = compared(nothing=0.001, unlisted=0.999, segment_drag=0.0)
    found = run([0.005], unlisted)
    assert len(found.steps) == 1 and found.left.comparison is unlisted


def test_a_second_one_that_does_not_converge_is_told(run: Any) -> None:
    sure = compared(nothing=0.001, unlisted=0.0, segment_drag=0.999)
    found = run([0.005], sure, (True, False))
    assert len(found.steps) == 1 and found.left.comparison is sure and "r-hat" in found.left.reason
    found = run([], sure, (False,))
    assert isinstance(found, NotAugmented) and "r-hat" in found.reason and found.left is None


def test_without_the_base_law_under_the_same_errors_nothing_is_added(run: Any) -> None:
    found = run([0.3], compared(nothing=1.0, unlisted=0.0), same_errors="it did not converge")
    assert isinstance(found, NotAugmented) and found.reason == "it did not converge"
