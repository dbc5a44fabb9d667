"""Which mechanisms are added one after the other, and what is kept of a comparison that added nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from skred.diagnosis.augment.add import Adding, add_mechanisms
from skred.diagnosis.augment.step import NotAugmented
from skred.diagnosis.clock import Clock
from skred.diagnosis.effort import Effort, Run
from skred.inference.between_events import BetweenEvents
from skred.inference.sampling import SamplerSettings

BASE: Any = SimpleNamespace(law=SimpleNamespace(id="pcm"), problem=None, plain=lambda: None)


def compared(**shares: float) -> Any:
    """A comparison with these probabilities."""
    ways = (BetweenEvents.COMMON,)
    candidates = {name: SimpleNamespace(best=name, likely_ways=ways, ways=None) for name in shares}
    under_errors = SimpleNamespace(base=BASE, candidates=candidates)
    return SimpleNamespace(probability=shares, leading=lambda name: under_errors, log_odds=3.0)


class MadeUp(Adding):
    """Adding with made-up p-values of the checks, second comparison, and which calibrations converge."""

    def __init__(self, p_values: list[float], second: Any, passed: tuple[bool, ...], reference: Any) -> None:
        super().__init__(reference, Run(SamplerSettings(), Effort(), Clock(lambda line: None)))
        self.p_values, self.second, self.gates = iter(p_values), second, iter(passed)

    def calibrated(self, base: Any, chosen: Any, way: Any, ways: Any) -> Any:
        return SimpleNamespace(gate=SimpleNamespace(passed=next(self.gates), problems=("r-hat",)))

    def checked(self, base: Any, calibration: Any, chosen: Any) -> Any:
        p_value = next(self.p_values)
        check = SimpleNamespace(p_value=p_value, fired=p_value <= 0.01)
        return SimpleNamespace(check=check, base=BASE)

    def compared(self, base: Any) -> Any:
        return self.second


def added(
    p_values: list[float],
    second: Any,
    passed: tuple[bool, ...] = (True, True),
    same_errors: str = "",
) -> Any:
    """What becomes of an obstacle that a first comparison is sure of."""
    reference: Any = SimpleNamespace(begin=lambda problem: None, on=lambda problem: ("base", same_errors))
    first = compared(nothing=0.0, unlisted=0.0, obstacle=1.0)
    return add_mechanisms(BASE, first, ("obstacle",), MadeUp(p_values, second, passed, reference))


def test_without_an_alarm_nothing_more_is_looked_for() -> None:
    found = added([0.02], compared(nothing=0.0, unlisted=0.0, segment_drag=1.0))
    assert len(found.steps) == 1 and found.reference == "base" and found.left is None


def test_after_an_alarm_the_comparison_has_to_be_sure() -> None:
    sure = compared(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    found = added([0.01, 0.5], sure)
    assert [step.candidate.best for step in found.steps] == ["obstacle", "segment_drag"]
    assert found.left is None
    unsure = compared(nothing=0.3, unlisted=0.0, segment_drag=0.7)
    found = added([0.01], unsure)
    assert len(found.steps) == 1 and found.left.comparison is unsure and not found.left.reason


def test_a_second_comparison_without_a_name_is_kept() -> None:
    unlisted = compared(nothing=0.001, unlisted=0.999, segment_drag=0.0)
    found = added([0.005], unlisted)
    assert len(found.steps) == 1 and found.left.comparison is unlisted


def test_a_second_one_that_does_not_converge_is_told() -> None:
    sure = compared(nothing=0.001, unlisted=0.0, segment_drag=0.999)
    found = added([0.005], sure, (True, False))
    assert len(found.steps) == 1 and found.left.comparison is sure and "r-hat" in found.left.reason
    found = added([], sure, (False,))
    assert isinstance(found, NotAugmented) and "r-hat" in found.reason and found.left is None


def test_without_the_base_law_under_the_same_errors_nothing_is_added() -> None:
    found = added([0.3], compared(nothing=1.0, unlisted=0.0), same_errors="it did not converge")
    assert isinstance(found, NotAugmented) and found.reason == "it did not converge"
