"""What the view of the force says was added, and where: orange is named only where something is orange."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import pytest
from bokeh.models import BoxAnnotation, Quad

from skred.dashboard.catalogue import VIEWS
from skred.dashboard.reading import read_given
from skred.dashboard.view import Asked
from skred.report.explore.figures import CHOSEN
from skred.report.explore.panel import Panel


def force_of(folder: Path) -> Panel:
    (kind,) = [one for one in VIEWS if one.id == "force"]
    found = read_given([folder])
    (panel,) = kind.make(found.runs[0], found, Asked())
    return panel


def is_orange(panel: Panel) -> bool:
    marks = [*panel.figure.select({"type": Quad}), *panel.figure.select({"type": BoxAnnotation})]
    return any(mark.fill_color == CHOSEN for mark in marks)


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("segment_friction", "Orange: where another surface"),
        ("constant_retardation", "added along the track"),
        ("sensor", "added to the readings of"),
        ("unexplained", "but this force itself"),
        ("nothing", "Nothing was added."),
    ],
)
def test_what_was_added_is_told_as_it_is_drawn(kind: str, told: str, results: Path, tmp_path: Path) -> None:
    from diagnosis_report_cases import write_documents  # found once `results` is made

    write_documents(kind, tmp_path)
    panel = force_of(tmp_path)
    assert told in panel.note
    assert ("Orange" in panel.note) == is_orange(panel)
    assert ("Nothing was added" in panel.note) == (kind == "nothing")


@pytest.mark.parametrize("of_fast", [True, False])
def test_a_force_on_fast_fronts_only_is_told(of_fast: bool, results: Path, tmp_path: Path) -> None:
    from diagnosis_report_cases import write_documents

    write_documents("segment_friction", tmp_path)
    verdict: dict[str, Any] = json.loads((tmp_path / "verdict.json").read_text())
    verdict["report"]["force"]["nil_at_typical_speed"] = of_fast
    (tmp_path / "verdict.json").write_text(json.dumps(verdict))
    panel = force_of(tmp_path)
    axis = panel.figure.children[0].yaxis[0].axis_label
    assert ("of a fast front" in axis) == of_fast
    assert ("at the typical speed it is nil" in panel.note) == of_fast
