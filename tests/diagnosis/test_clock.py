"""How far a stage of a diagnosis has come, in words."""

from __future__ import annotations

import pytest

from skred.diagnosis.clock import Clock


def test_what_is_left_is_reckoned_from_the_first_that_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage may begin with something else, which took 60 s here."""
    now = [0.0]
    monkeypatch.setattr("skred.diagnosis.clock.time.monotonic", lambda: now[0])
    told = list[str]()
    clock = Clock(told.append)
    clock.stage("check", "clean campaigns")
    for done in range(1, 6):
        now[0] = 60.0 + 8.0 * (done - 1)
        clock.progress(done, 9)
    assert told == [
        "clean campaigns",
        "  2 of 9, about 56 s left",
        "  4 of 9, about 40 s left",
    ]
    clock.end()
    assert clock.seconds == {"check": 92.0}
