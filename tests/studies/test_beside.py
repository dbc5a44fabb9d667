"""Two versions on the same trials: what only one of them has right is counted for that one."""

from __future__ import annotations

from typing import Any

from skred.prove.scorecard import DIAGNOSIS
from studies.proof.beside import EARLIER, ROWS, beside

DRAG = {"id": "turbulent_drag", "listed": True, "s_from_m": None, "s_to_m": None}


def trial(name: str, *hidden: dict[str, Any]) -> dict[str, Any]:
    truth = {
        "kind": "sparse",
        "hidden": "listed" if hidden else "nothing",
        "mechanisms": list(hidden),
        "snr": 8.0,
    }
    return {"trial": name, "truth": truth}


def answer(mechanism: str | None, seconds: float) -> dict[str, Any]:
    verdict = "missing_physics" if mechanism else "nothing_missing"
    probability = (
        {"nothing": 0.1, "turbulent_drag": 0.9} if mechanism else {"nothing": 0.8, "turbulent_drag": 0.2}
    )
    return {"verdict": verdict, "mechanism": mechanism, "indistinguishable": [], "probability": probability,
            "cpu_seconds": seconds}  # fmt: skip


def test_each_version_has_its_own() -> None:
    trials = [trial("a", DRAG), trial("b", DRAG), trial("c")]
    now = {"a": answer("turbulent_drag", 4.0), "b": answer(None, 6.0), "c": answer("turbulent_drag", 5.0)}
    then = {"a": answer(None, 2.0), "b": answer(None, 2.0), "c": answer(None, 3.0)}
    table = beside(trials, {DIAGNOSIS: now, EARLIER: then})
    rows = {
        row.split(" | ")[0].strip("| "): row.split(" | ")[1:6]
        for row in table.splitlines()[2 : 2 + len(ROWS)]
    }
    assert rows["no alarm where nothing is hidden"] == ["1", "0", "1", "0", "1"]
    assert rows["right first name"] == ["2", "1", "0", "1", "0"]
    assert rows["a verdict"] == ["3", "3", "3", "0", "0"]
    assert "Single names that are right: later 1 of 2, earlier 0 of 0." in table
    assert "Median CPU time, sparse: later 5 s, earlier 2 s." in table


def test_a_missing_answer_is_a_failure() -> None:
    trials = [trial("a", DRAG)]
    table = beside(trials, {DIAGNOSIS: {"a": answer("turbulent_drag", 4.0)}, EARLIER: {}})
    assert "| a verdict | 1 | 1 | 0 | 1 | 0 | 1 |" in table
