"""Campaigns of another hand: they can be read, and answers are judged by what is hidden."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from skred.campaign import read_campaign
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from studies.another_hand.campaigns import HANDS, Hidden, hidden, unpack
from studies.another_hand.page import judged, sections
from studies.files import RESULTS, read

DRAG = Hidden("pcm", ("segment_drag",), "drag", 50.0, (0.2, 0.3), 1.0, is_odd=False, differs=False)


def answer(verdict: str, *names: str, tied: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"verdict": verdict, "mechanisms": list(names), "tied": list(tied)}


@pytest.mark.parametrize(
    ("ids", "given", "worth"),
    [
        ((), answer("nothing_missing"), "right"),
        ((), answer("cannot_tell"), "right"),
        ((), answer("unexplained"), "false alarm"),
        (("segment_drag",), answer("cannot_tell"), "missed"),
        (("segment_drag",), answer("missing_physics", "segment_drag"), "right name"),
        (("segment_drag",), answer("missing_physics", "entrainment"), "wrong"),
        (("segment_drag",), answer("missing_physics", "entrainment", tied=("segment_drag",)), "in the tie"),
        (("segment_drag",), answer("missing_physics", "obstacle", tied=("segment_drag",)), "in the tie"),
        (("segment_drag",), answer("unexplained", tied=("segment_drag",)), "unexplained"),
        (("segment_drag",), answer("missing_physics", "viscous_drag", "segment_drag"), "wrong"),
        (("unlisted",), answer("unexplained"), "unexplained"),
        (("unlisted",), answer("missing_physics", "obstacle", tied=("unlisted",)), "in the tie"),
        (("covariate_friction", "segment_drag"), answer("missing_physics", "segment_drag"), "right name"),
    ],
)
def test_an_answer_is_judged_by_its_first_name_and_its_tie(ids: Any, given: Any, worth: str) -> None:
    assert judged(replace(DRAG, ids=ids), given) == worth


def test_every_campaign_can_be_read_and_has_its_answer(tmp_path: Path) -> None:
    found = read(RESULTS / "another_hand.json")
    assert list(found["answers"]) == [name for hand in HANDS for name in hidden(hand)]
    assert set(found["again"]) <= set(found["answers"]) and len(found["answers"]) == 68
    for hand in HANDS:
        for name, truth in hidden(hand).items():
            campaign = read_campaign(unpack(hand, name, tmp_path))
            assert campaign.origin == "simulated" and campaign.n_events >= 6
            assert load_law(truth.base_model).id == truth.base_model
            assert set(truth.ids) <= {*mechanisms(), "unlisted"}


def test_names_that_later_code_gives_are_told() -> None:
    assert "by another hand: the second" in sections() and "instead of segment_drag" in sections()
