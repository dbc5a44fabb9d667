"""What would change a ranking, with scores made up: each number by another route."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skred.inference.paired import paired_difference
from skred.model_selection.ranking import ranking, rival

EVENTS = [f"e{k}" for k in range(7)]


def model(name: str, pointwise: list[float], evidence: float, waic: float = 0.0) -> dict[str, Any]:
    elpd = float(np.sum(pointwise))
    return {
        "id": name,
        "exact": {"elpd": elpd, "pointwise": pointwise},
        "loo": {"elpd": elpd + 0.1},
        "waic": {"elpd": elpd + waic},
        "evidence": {"mean": evidence},
    }


def smallest_reversal(best: list[float], other: list[float]) -> int | None:
    """By trying all sets; one avalanche at least is left."""
    lead = np.subtract(best, other)
    for n in range(1, len(lead)):
        for gone in combinations(range(len(lead)), n):
            if np.delete(lead, gone).sum() < -1e-9:
                return n
    return None


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=7, max_size=7))
def test_the_smallest_set_that_reverses_is_found(lead: list[float]) -> None:
    lead = [round(value, 3) for value in lead]
    if sum(lead) < 0.0:
        lead = [-value for value in lead]
    best, other = np.zeros(7).tolist(), [-value for value in lead]
    found = rival(best, other, EVENTS)["reversed_without"]
    wanted = smallest_reversal(best, other)
    assert (None if found is None else len(found)) == wanted
    if found is not None:
        kept = [value for event, value in zip(EVENTS, lead, strict=True) if event not in found]
        assert sum(kept) < 0.0


def test_the_difference_without_each_avalanche() -> None:
    best, other = [-1.0, -2.0, -3.0, -4.0], [-1.5, -2.5, -1.9, -9.0]
    found = rival(best, other, EVENTS[:4])
    for k, one in enumerate(found["without_each"]):
        kept = [j for j in range(4) if j != k]
        expected = sum(other[j] for j in kept) - sum(best[j] for j in kept)
        assert one == {"event": EVENTS[k], "difference": pytest.approx(expected)}
    assert found["reversed_without"] == ["e3"] and found["difference"] == pytest.approx(-4.9)
    assert found["ratio"] == pytest.approx(4.9 / found["se"]) and not found["counts"]


def test_what_counts_hangs_on_the_avalanches_that_favour_the_best() -> None:
    lead = np.array([9.0, 1.0, 1.1, 0.9, 1.0, 1.05, 0.95, 1.0, 1.0, 1.0] * 2)
    events = [f"e{k}" for k in range(len(lead))]
    found = rival(np.zeros(len(lead)).tolist(), (-lead).tolist(), events)
    assert found["counts"] and found["events_needed"] is None
    gone = found["counts_not_without"]
    kept = [value for event, value in zip(events, lead, strict=True) if event not in gone]
    assert not paired_difference(-np.array(kept), np.zeros(len(kept))).practical
    kept_before = [value for event, value in zip(events, lead, strict=True) if event not in gone[:-1]]
    assert paired_difference(-np.array(kept_before), np.zeros(len(kept_before))).practical


def test_how_many_avalanches_it_takes() -> None:
    """So many copies of the same scores do count, and one set less does not."""
    lead = np.array([1.0, -0.8, 0.9, -0.5, 0.4])
    found = rival(np.zeros(5).tolist(), (-lead).tolist(), EVENTS[:5])
    assert not found["counts"]
    copies = found["events_needed"] / 5
    enough, too_few = np.tile(lead, int(np.ceil(copies)) + 1), np.tile(lead, int(copies * 0.8))
    assert paired_difference(-enough, np.zeros(len(enough))).practical
    assert not paired_difference(-too_few, np.zeros(len(too_few))).practical
    alike = rival([-1.0, -2.0], [-1.0, -2.0], EVENTS[:2])
    assert alike["events_needed"] is None and alike["ratio"] is None and alike["reversed_without"] is None


def test_orders_by_each_score() -> None:
    models = [
        model("a", [-1.0] * 7, -9.0),
        model("b", [-1.2] * 7, -8.0),
        model("c", [-2.0] * 7, -30.0, waic=20.0),
    ]
    found = ranking(models, EVENTS)
    assert found is not None and found["best"] == "a"
    assert found["orders"] == {
        "exact": ["a", "b", "c"],
        "loo": ["a", "b", "c"],
        "waic": ["c", "a", "b"],
        "evidence": ["b", "a", "c"],
    }
    assert [one["id"] for one in found["rivals"]] == ["b", "c"]
    assert found["rivals"][0]["evidence_difference"] == pytest.approx(1.0)
    assert ranking(models[:1], EVENTS) is None and ranking([], EVENTS) is None
