"""Ranking of laws, with entries made up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from skred.inference.leave_one_out import ExactLoo
from skred.model_selection.compare import leave_one_out_entry, rank

EVENTS = 22
BASE = -15.0 + np.sin(np.arange(EVENTS))


def entry(law: str, shift: Any = 0.0, passed: bool = True) -> dict[str, Any]:
    made: dict[str, Any] = {"id": law, "gate": {"passed": passed, "problems": []}, "exact": None}
    if passed:
        pointwise = BASE - np.broadcast_to(shift, EVENTS)
        made["exact"] = {"elpd": float(pointwise.sum()), "pointwise": pointwise.tolist()}
    return made


def ranked(entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """With draws that scatter little about each event's score, for the weights."""
    rng, trees = np.random.default_rng(0), {}
    for made in entries:
        if made["exact"]:
            terms = made["exact"]["pointwise"] + 0.01 * rng.standard_normal((2, 200, EVENTS))
            data = xr.Dataset({"recordings": (("chain", "draw", "event"), terms)})
            trees[made["id"]] = xr.DataTree.from_dict({"log_likelihood": data, "posterior": data})
    return rank(entries, trees)


def uneven(total: float, scatter: float) -> np.ndarray:
    """Shifts with a given sum and standard deviation over events."""
    z = np.cos(np.arange(EVENTS))
    z = (z - z.mean()) / z.std(ddof=1)
    return total / EVENTS + scatter * z


def test_best_first_whatever_the_order() -> None:
    found = ranked([entry("c", 2.0), entry("a"), entry("b", 1.0)])
    assert [e["id"] for e in found] == ["a", "b", "c"]
    assert [e["difference"]["elpd"] for e in found] == pytest.approx([0.0, -EVENTS, -2 * EVENTS])


def test_differences_are_paired() -> None:
    """Their error is that of the differences, not of the scores."""
    _, second = ranked([entry("a"), entry("b", uneven(10.0, 0.5))])
    assert second["difference"]["se"] == pytest.approx(np.sqrt(EVENTS) * 0.5)
    assert second["difference"]["se_doubled"] == pytest.approx(np.sqrt(EVENTS))


@pytest.mark.parametrize(
    ("total", "scatter", "practical"),
    [
        (3.9, 0.01, False),  # sure, but too small to matter
        (4.1, 0.01, True),
        (20.0, 2.0, True),  # twice its error is 18.8
        (18.0, 2.0, False),
    ],
)
def test_practical_is_at_least_four_and_twice_its_error(
    total: float, scatter: float, practical: bool
) -> None:
    _, second = ranked([entry("a"), entry("b", uneven(total, scatter))])
    assert second["difference"]["practical"] is practical


def test_a_tie() -> None:
    found = ranked([entry("a"), entry("b")])
    assert [e["id"] for e in found] == ["a", "b"]
    for e in found:
        assert e["difference"] == {"elpd": 0.0, "se": 0.0, "se_doubled": 0.0, "practical": False}


def test_a_failed_gate_comes_last_without_difference() -> None:
    found = ranked([entry("bad", passed=False), entry("worse", 1.0), entry("best")])
    assert [e["id"] for e in found] == ["best", "worse", "bad"]
    assert "difference" not in found[-1] and "weight" not in found[-1]
    assert [e["weight"] for e in found[:2]] == pytest.approx([1.0, 0.0], abs=1e-3)


def test_laws_that_predict_different_events_share_the_weight() -> None:
    """Half of the events each is predicted well by one of them: together they predict best.

    By its total of seven nats more the first would have all of it.
    """
    side = np.where(np.arange(EVENTS) % 2, 4.0, -4.0)
    found = ranked([entry("a", side), entry("b", 0.3 - side), entry("c", 9.0)])
    assert [e["weight"] for e in found] == pytest.approx([0.5, 0.5, 0.0], abs=0.05)


@pytest.mark.parametrize("entries", [[], [entry("bad", passed=False)], [entry("only")]])
def test_fewer_than_two(entries: list[dict[str, Any]]) -> None:
    assert [e["id"] for e in ranked(entries)] == [e["id"] for e in entries]


def test_events_that_were_refitted_are_exact_and_the_others_are_not() -> None:
    by_importance = np.array([-1.0, -2.0, -3.0, -4.0])
    refits = ExactLoo(np.array([-2.5, -4.5]), 0.03, ("d",))
    made = leave_one_out_entry(by_importance, refits, [1, 3], ["a", "b", "c", "d"])
    assert made["pointwise"] == [-1.0, -2.5, -3.0, -4.5] and made["elpd"] == pytest.approx(-11.0)
    assert made["refitted"] == ["b", "d"] and made["failed_refits"] == ["d"] and made["mcse"] == 0.03
    assert made["se"] == pytest.approx(np.sqrt(4 * np.var([-1.0, -2.5, -3.0, -4.5], ddof=1)))
    assert by_importance[1] == -2.0
    none = leave_one_out_entry(by_importance, None, [], ["a", "b", "c", "d"])
    assert none["elpd"] == pytest.approx(-10.0) and none["refitted"] == [] and none["mcse"] == 0.0
