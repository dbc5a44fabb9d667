"""Ryggfonn beside the code before and an audit: what its tables say of each."""

from __future__ import annotations

import math
from copy import deepcopy

import pytest

from studies.files import RESULTS, read
from studies.ryggfonn.before import before_and_now, beside_the_audit

LAWS = ("coulomb", "pcm", "constant", "voellmy", "pcm-places-stated")


@pytest.fixture
def found():
    return {name: read(RESULTS / "ryggfonn" / f"{name}.json") for name in LAWS}


def row(table, *begins):
    return next(line for line in table.splitlines() if line.startswith("| " + " | ".join(begins)))


def test_what_a_strength_in_common_has_is_taken_from_how_probable_it_is(found):
    """If the strength in common is as probable as its prior, no way has more than it."""
    changed = deepcopy(found)
    drag = next(one for one in changed["coulomb"]["candidates"] if one["id"] == "segment_drag")
    drag |= {"log_bayes_factor": 120.0, "strength": {"ways": {"common": 0.5}}}
    assert row(before_and_now(changed), "`coulomb`", "`segment_drag`").endswith("| 120.0 | 120.0 |")
    drag["strength"]["ways"]["common"] = 0.5 * math.exp(-7.0)
    assert row(before_and_now(changed), "`coulomb`", "`segment_drag`").endswith("| 113.0 | 120.0 |")


def test_the_audit_is_named_the_same_avalanches_only_where_they_are(found):
    changed = deepcopy(found)
    for event in changed["pcm"]["influence"]["events"]:
        if event["event"] in ("19880315", "19890217", "19920311", "20030406", "20050416"):
            event["log_bayes_factor"] = -1.0
    assert row(beside_the_audit(changed), "avalanches that take").endswith("| the same five |")
    changed = deepcopy(found)
    for event in changed["pcm"]["influence"]["events"]:
        if event["event"] == "19750225":
            event["log_bayes_factor"] = -5.0
    assert "| 19750225, 19920311," in row(beside_the_audit(changed), "avalanches that take")
