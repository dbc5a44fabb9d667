"""Which mechanisms are added one after the other, and what is kept of a comparison that added nothing."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from skred.diagnosis.augment import add
from skred.diagnosis.augment.step import NotAugmented
from skred.diagnosis.clock import Clock
from skred.diagnosis.effort import Effort, Run
from skred.inference.between_events import BetweenEvents
from skred.inference.sampling import SamplerSettings

BASE: Any = SimpleNamespace(law=SimpleNamespace(id="pcm"), problem=None, plain=lambda: None)
Added = Callable[..., Any]


def compared(**shares: float) -> Any:
    """A comparison with these probabilities."""
    ways = (BetweenEvents.COMMON,)
    candidates = {name: SimpleNamespace(best=name, likely_ways=ways, ways=None) for name in shares}
    under_errors = SimpleNamespace(error_model="robust", base=BASE, candidates=candidates)
    return SimpleNamespace(probability=shares, leading=lambda name: under_errors, log_odds=3.0)


def calibration(passed: bool, of: str = "augmented") -> Any:
    return SimpleNamespace(gate=SimpleNamespace(passed=passed, problems=("r-hat",)), of=of)


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> Added:
    """What becomes of an obstacle that a first comparison is sure of.

    The checks' p-values, what further comparisons say, and which calibrations converge are made up.
    """

    def found(
        p_values: list[float],
        second: Any,
        passed: tuple[bool, ...] = (True, True),
        same_errors: bool = True,
        max_mechanisms: int = 2,
    ) -> Any:
        left, gates = iter(p_values), iter(passed)
        further = iter(second if isinstance(second, tuple) else (second, second))

        def checked(*given: Any) -> Any:
            p_value = next(left)
            again = next(further) if max_mechanisms > 1 else None
            return SimpleNamespace(p_value=p_value, fired=p_value <= 0.01), again

        monkeypatch.setattr(add, "augmented_problem", lambda *given: None)
        monkeypatch.setattr(add, "calibrate_surely", lambda *given: calibration(next(gates)))
        monkeypatch.setattr(add, "check_again", checked)
        monkeypatch.setattr(add, "reference", lambda own, problem: lambda: calibration(same_errors, "base"))
        first = compared(nothing=0.0, unlisted=0.0, obstacle=1.0)
        run = Run(SamplerSettings(), Effort(max_mechanisms=max_mechanisms), Clock(lambda line: None))
        return add.add_mechanisms(BASE, first, ("obstacle",), calibration(True), run)

    return found


def test_without_an_alarm_nothing_more_is_added_and_what_led_is_told(added: Added) -> None:
    again = compared(nothing=0.0, unlisted=0.0, segment_drag=1.0)
    found = added([0.02], again)
    assert len(found.steps) == 1 and found.reference.of == "base"
    assert found.left.comparison is again and found.left.reason == "no alarm, p = 0.02"
    found = added([0.02], (None,))
    assert len(found.steps) == 1 and found.left is None


def test_after_an_alarm_the_comparison_has_to_be_sure(added: Added) -> None:
    sure = compared(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    found = added([0.01, 0.5], sure)
    assert [step.candidate.best for step in found.steps] == ["obstacle", "segment_drag"]
    assert found.left.reason == "no alarm, p = 0.5"
    unsure = compared(nothing=0.3, unlisted=0.0, segment_drag=0.7)
    found = added([0.01], unsure)
    assert len(found.steps) == 1 and found.left.comparison is unsure and not found.left.reason


def test_what_would_be_a_third_is_reported_and_not_added(added: Added) -> None:
    sure = compared(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    found = added([0.01, 0.002], sure)
    assert len(found.steps) == 2 and found.left.comparison is sure
    assert found.left.reason == "no more than 2 are added"
    unsure = compared(nothing=0.3, unlisted=0.0, segment_drag=0.7)
    found = added([0.01, 0.002], (sure, unsure))
    assert len(found.steps) == 2 and found.left.comparison is unsure and not found.left.reason


def test_who_asks_for_one_mechanism_gets_no_further_comparison(added: Added) -> None:
    sure = compared(nothing=0.005, unlisted=0.0, segment_drag=0.995)
    found = added([0.01], sure, max_mechanisms=1)
    assert len(found.steps) == 1 and found.left is None


def test_a_second_comparison_without_a_name_is_kept(added: Added) -> None:
    unlisted = compared(nothing=0.001, unlisted=0.999, segment_drag=0.0)
    found = added([0.005], unlisted)
    assert len(found.steps) == 1 and found.left.comparison is unlisted


def test_a_second_one_that_does_not_converge_is_told(added: Added) -> None:
    sure = compared(nothing=0.001, unlisted=0.0, segment_drag=0.999)
    found = added([0.005], sure, (True, False))
    assert len(found.steps) == 1 and found.left.comparison is sure and "r-hat" in found.left.reason
    found = added([], sure, (False,))
    assert isinstance(found, NotAugmented) and "r-hat" in found.reason and found.left is None


def test_what_cannot_be_sampled_where_avalanches_differ_is_in_common(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gates = iter((False, True))
    monkeypatch.setattr(add, "augmented_problem", lambda *given: None)
    monkeypatch.setattr(add, "calibrate_surely", lambda *given: calibration(next(gates)))
    candidate: Any = SimpleNamespace(likely_ways=(BetweenEvents.SOME,), ways=None)
    curve: Any = "obstacle"
    found, way = add.calibrated(BASE, candidate, [curve], SamplerSettings())
    assert found is not None and found.gate.passed and way is BetweenEvents.COMMON


def test_where_the_numerics_break_down_that_way_of_differing_is_left_out(
    added: Added, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(base: Any, chosen: Any, way: BetweenEvents, ways: Any) -> None:
        if way is BetweenEvents.SOME or chosen[-1] == "segment_drag":
            raise np.linalg.LinAlgError("Matrix is not positive definite")

    monkeypatch.setattr(add, "augmented_problem", broken)
    monkeypatch.setattr(add, "calibrate_surely", lambda *given: calibration(True))
    candidate: Any = SimpleNamespace(likely_ways=(BetweenEvents.SOME,), ways=None)
    curve: Any = "obstacle"
    found, way = add.calibrated(BASE, candidate, [curve], SamplerSettings())
    assert found is not None and found.gate.passed and way is BetweenEvents.COMMON
    curve = "segment_drag"
    assert add.calibrated(BASE, candidate, [curve], SamplerSettings())[0] is None


def test_where_the_numerics_break_down_beside_the_first_one_that_stays(
    added: Added, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first answer is not lost with the second."""
    sure = compared(nothing=0.001, unlisted=0.0, segment_drag=0.999)
    whole = add.calibrated

    def second_breaks(base: Any, candidate: Any, chosen: Any, settings: Any) -> Any:
        return whole(base, candidate, chosen, settings) if len(chosen) == 1 else (None, BetweenEvents.COMMON)

    monkeypatch.setattr(add, "calibrated", second_breaks)
    found = added([0.005], sure)
    assert len(found.steps) == 1
    assert found.left.reason == "the numerics broke down as pcm + segment_drag was calibrated"


def test_without_the_base_law_under_the_same_errors_nothing_is_added(added: Added) -> None:
    found = added([0.3], compared(nothing=1.0, unlisted=0.0), same_errors=False)
    assert isinstance(found, NotAugmented)
    assert found.reason == "the gate of pcm under robust errors failed: r-hat"
