"""What a comparison says, in every case that can come."""

from __future__ import annotations

from typing import Any

import pytest

from skred.model_selection.statement import changes, statement


def row(sensor: str, **changes: Any) -> dict[str, Any]:
    """Check of fit at a sensor where the law fits."""
    entry: dict[str, Any] = {
        "sensor": sensor, "unit": "m/s", "n_recorded": 11, "recorded_mean": 15.7, "recorded_sd": 6.0,
        "predicted_mean": 16.1, "predicted_sd": 5.9, "p_mean": 0.9, "p_sd": 1.0, "fits": True,
    }  # fmt: skip
    return entry | changes


def model(name: str, elpd: float = -320.0, **changes: Any) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "id": name,
        "title": f"law {name}",
        "gate": {"passed": True, "problems": []},
        "exact": {"elpd": elpd, "pointwise": [elpd], "refitted": ["e"], "failed_refits": []},
        "difference": {"elpd": 0.0, "se": 0.0, "practical": False},
        "evidence": {"mean": elpd - 3.0, "spread": 0.1},
        "loo": {"n_bad": 0, "pareto_k_max": 0.3},
        "fit": [row("LC"), row("CD")],
        "fits": True,
        "fit_level": 0.01,
    }
    return entry | changes


def behind(name: str, by: float, se: float, practical: bool, **changes: Any) -> dict[str, Any]:
    difference = {"elpd": -by, "se": se, "practical": practical}
    return model(name, -320.0 - by, difference=difference, **changes)


def failed(name: str) -> dict[str, Any]:
    nothing = dict.fromkeys(("loo", "waic", "exact", "difference", "evidence", "weight"))
    problems = ["r-hat 1.200 exceeds 1.01: more --tune"]
    return model(name, **nothing, gate={"passed": False, "problems": problems})


def told(*models: dict[str, Any], n_events: int = 22) -> str:
    return " ".join(statement({"models": list(models), "campaign": {"n_events": n_events}}))


def test_a_clear_winner() -> None:
    text = told(model("A"), behind("B", 12.345, 3.0, True), behind("C", 40.0, 5.0, True))
    assert "over 22 avalanches the recordings prefer law A (elpd -320.00)" in text
    assert "law B predicts worse by 12.35 (standard error 3.00)" in text or "by 12.34 (" in text
    assert "law C predicts worse by 40.00" in text
    assert "no practical difference" not in text
    assert "standard errors are optimistic" in text
    assert "Evidence by sequential Monte Carlo agrees" in text


def test_laws_close_to_each_other_are_not_preferred() -> None:
    text = told(model("A"), behind("B", 1.5, 2.0, False), behind("C", 40.0, 5.0, True))
    assert "recordings put first law A" in text and "prefer law" not in text
    assert "law B is behind by 1.50 (standard error 2.00): no practical difference" in text
    assert "law C predicts worse by 40.00" in text


def test_a_law_whose_chains_failed_is_not_compared() -> None:
    text = told(model("A"), failed("B"))
    assert "Only law A was calibrated" in text
    assert "The chains of law B did not converge, so it is not compared: r-hat 1.200 exceeds 1.01" in text


def test_nothing_to_compare() -> None:
    text = told(failed("A"), failed("B"))
    assert text.startswith("The chains of no law converged") and "elpd" not in text
    assert text.count("did not converge, so it is not compared") == 2


def test_evidence_that_disagrees_is_said() -> None:
    other = behind("B", 6.0, 1.0, True, evidence={"mean": -300.0, "spread": 0.7})
    text = told(model("A"), other)
    assert "prefers law B instead" in text and "differ by at most 0.70" in text


@pytest.mark.parametrize("n_events", [99, 100])
def test_optimism_of_few_events_is_said(n_events: int) -> None:
    text = told(model("A"), behind("B", 12.0, 3.0, True), n_events=n_events)
    assert ("optimistic" in text) is (n_events < 100)


def test_unreliable_scores_are_said() -> None:
    bad = model("A", loo={"n_bad": 2, "pareto_k_max": 0.93})
    unconverged = behind("B", 6.0, 1.0, True)
    unconverged["exact"]["failed_refits"] = ["19880315", "20050416"]
    text = told(bad, unconverged)
    assert "unreliable for 2 events of law A (Pareto k up to 0.93)" in text
    assert "2 refits of law B did not converge" in text


def test_scores_by_importance_sampling_are_not_called_exact() -> None:
    quick = {"elpd": -320.0, "pointwise": [-320.0], "refitted": [], "failed_refits": []}
    text = told(model("A", exact=quick), behind("B", 12.0, 3.0, True))
    assert "By leave-one-event-out (exact where importance sampling is unreliable)" in text


def both(ours: list[dict[str, Any]], theirs: list[dict[str, Any]], reason: str | None = None) -> str:
    return " ".join(changes({"models": ours, "pooled": {"reason": reason, "models": theirs}}))


def test_what_changes_when_the_order_stays() -> None:
    ours = [model("A"), behind("B", 70.0, 20.0, True)]
    theirs = [model("A", -300.0), behind("B", 14.7, 4.0, True)]
    text = both(ours, theirs)
    assert "same order; behind the best: B -70.0 (pooled -14.7)" in text
    assert "worse, by 20.0 in elpd" in text and "what the law or the stated errors miss" in text


def test_what_changes_when_the_order_does() -> None:
    text = both([model("B"), behind("A", 3.0, 1.0, False)], [model("A", -350.0), model("B", -340.0)])
    assert "The order of the laws changes: A, B pooled, B, A hierarchically" in text
    assert "better, by 20.0 in elpd" in text


def test_what_changes_without_a_pooled_calibration() -> None:
    text = both([model("A")], [], reason="an event did not reach 9 sensors")
    assert "There is no pooled calibration here: an event did not reach 9 sensors." in text
    assert "elpd" not in text
    assert len(changes({"models": [failed("A")], "pooled": {"reason": None, "models": [model("A")]}})) == 1


def test_avalanches_that_stop_unseen() -> None:
    row = {"sensor": "LC", "reached": 0.86, "recorded_reached": 0.95}
    text = both([model("A", new_avalanche=[row])], [model("A")])
    assert "86 % of new avalanches come to LC, of recorded ones 95 %" in text
    text = both([model("A", new_avalanche=[row | {"recorded_reached": 0.88}])], [model("A")])
    assert "of recorded ones" not in text


def test_a_law_that_misses_is_told_to_however_good_its_rank() -> None:
    missed = row("CD", predicted_mean=32.04, p_mean=0.0002, fits=False)
    text = told(model("A", fits=False, fit=[row("LC"), missed]), behind("B", 12.0, 3.0, True))
    assert "the recordings prefer law A" in text
    assert "law A misses the recordings at CD, more than chance allows" in text
    assert "At CD it predicts a mean reading of 32.0 m/s; the 11 recorded avalanches have 15.7 m/s." in text
    assert "law B misses" not in text and "LC" not in text
