"""The figure of what an answer hangs on: which avalanches and readings it names where there are many."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import pytest

from skred.report.diagnosis.influence import has_influence, influence_figure


def document(n_events: int, n_sensors: int) -> dict[str, Any]:
    """A verdict that needs 10 of 20 nats: it has 8 without event 2, 9 without sensor 3, else 19."""
    events = [{"event": f"e{k}", "log_bayes_factor": 8.0 if k == 2 else 19.0} for k in range(n_events)]
    sensors = [
        {"kind": "sensor", "sensor": f"s{k}", "n": 5, "log_bayes_factor": 9.0 if k == 3 else 19.0}
        for k in range(n_sensors)
    ]
    return {
        "influence": {
            "answer": "segment_friction",
            "log_bayes_factor": 20.0,
            "needed": 10.0,
            "events": events,
            "readings": sensors,
            "carried_by": ["e4"],
            "without_them": 19.0,
            "alarm": {"carried_by": ["e2"], "without_them": 8.0},
            "rival": {"id": "viscous_drag", "ahead": 2.0, "carried_by": ["e4"], "without_them": -1.0},
        }
    }


def names(n_events: int, n_sensors: int) -> list[list[str]]:
    """What the axes name, avalanches and then readings."""
    figure = influence_figure(document(n_events, n_sensors))
    try:
        return [[label.get_text() for label in axes.get_xticklabels()] for axes in figure.axes[:2]]
    finally:
        plt.close(figure)


def test_of_few_all_are_named_the_worst_first() -> None:
    events, sensors = names(6, 5)
    assert events[0] == "e2" and sorted(events) == [f"e{k}" for k in range(6)]
    assert sensors == [f"s{k} (5)" for k in range(5)]


@pytest.mark.parametrize(("n_events", "n_sensors"), [(60, 5), (6, 60), (60, 60)])
def test_of_many_only_those_that_the_answer_needs(n_events: int, n_sensors: int) -> None:
    events, sensors = names(n_events, n_sensors)
    assert len(events) == n_events and len(sensors) == n_sensors
    if n_events > 40:
        assert {name for name in events if name} == {"e2", "e4"}
    if n_sensors > 40:
        assert [name for name in sensors if name] == ["s3 (5)"]


def test_what_carries_the_name_has_a_ring_and_older_verdicts_have_none() -> None:
    found = document(6, 5)
    figure = influence_figure(found)
    told = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert "without all that carry the alarm" in told
    assert sum(one.startswith("carries the name: without, viscous drag") for one in told) == 1
    del found["influence"]["alarm"], found["influence"]["rival"]
    older = influence_figure(found)
    told = [text.get_text() for legend in older.legends for text in legend.get_texts()]
    assert not any("carries the name" in one for one in told)
    plt.close("all")


def test_a_number_that_is_null_means_no_figure() -> None:
    found = document(6, 5)
    assert has_influence(found)
    found["influence"]["events"][1]["log_bayes_factor"] = None
    assert not has_influence(found)
