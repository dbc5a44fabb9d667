"""Alarms beside which nothing is less probable than a limit: false, of strong effects and of weak ones."""

from __future__ import annotations

from typing import Any

from skred.prove.scoring.answers import Pair
from studies.thresholds.nothing_at_most import told


def pair(snr: float, verdict: str, nothing: float) -> Pair:
    effect = {"id": "turbulent_drag", "listed": True, "s_from_m": None, "s_to_m": None}
    truth: dict[str, Any] = {"kind": "sparse", "hidden": "listed" if snr else "nothing", "snr": snr}
    truth["mechanisms"] = [effect] if snr else []
    mechanism = "turbulent_drag" if verdict == "missing_physics" else None
    probability = {"nothing": nothing, "turbulent_drag": 1.0 - nothing}
    return Pair("a", truth, {"verdict": verdict, "mechanism": mechanism, "probability": probability})


def test_what_stays_below_a_limit_is_counted() -> None:
    pairs = [
        pair(0.0, "missing_physics", 0.25),
        pair(0.0, "nothing_missing", 0.05),  # no alarm, whatever the odds
        pair(8.0, "missing_physics", 0.01),
        pair(8.0, "missing_physics", 0.15),
        pair(3.0, "missing_physics", 0.3),
    ]

    def hits(limit: float) -> list[tuple[int, int]]:
        found = told(pairs, limit)
        return [(found[key]["hits"], found[key]["n"]) for key in ("false", "found", "found_weak")]

    assert hits(0.5) == [(1, 2), (2, 2), (1, 1)]
    assert hits(0.2) == [(0, 2), (2, 2), (0, 1)]
    assert hits(0.1) == [(0, 2), (1, 2), (0, 1)]
