"""What a diagnosis leaves in its folder."""

from __future__ import annotations

from pathlib import Path

from skred.campaign.parts import of_events
from skred.diagnosis.diagnose import Effort
from skred.inference.hierarchical import hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.laws import load_law
from skred.trials.draw import draw_trial
from skred.work.diagnose import diagnose_to


def test_nothing_of_an_earlier_diagnosis_is_left(tmp_path: Path) -> None:
    """Draws of a mechanism that was not let in now would be taken for its own; other files are not ours."""
    for name in ("augmented.nc", "places_2.png", "notes.txt"):
        (tmp_path / name).write_text("earlier")
    campaign = draw_trial(1001, kind="sparse", hidden="nothing", base="constant").campaign
    few = hierarchical_problem(of_events(campaign, range(4)))
    document = diagnose_to(few, load_law("constant"), SamplerSettings(), Effort(), tmp_path)
    assert document["verdict"] == "cannot_tell" and "only 4 avalanches" in document["reason"]
    assert {file.name for file in tmp_path.iterdir()} == {
        "notes.txt", "report.html", "verdict.json", "where.png",
    }  # fmt: skip
