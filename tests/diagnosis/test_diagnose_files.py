"""What a diagnosis leaves in its folder."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import xarray as xr

import skred.diagnosis.run as module
from skred.campaign.parts import of_events
from skred.diagnosis.effort import Effort
from skred.diagnosis.outcome import Diagnosis, MechanismsAdded
from skred.diagnosis.run import diagnose_to
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.sampling import SamplerSettings
from skred.parallel.processes import helpers
from skred.physics.laws import load_law
from skred.report.folders import write_reports
from skred.simulator.draw import draw_trial


@pytest.fixture
def few() -> HierarchicalProblem:
    """Too few avalanches for a diagnosis."""
    campaign = draw_trial(1001, kind="sparse", hidden="nothing", base="constant").campaign
    return hierarchical_problem(of_events(campaign, range(4)))


def test_nothing_of_an_earlier_diagnosis_is_left(few: HierarchicalProblem, tmp_path: Path) -> None:
    """Draws of a mechanism that was not added now would be taken for its own; other files are not ours."""
    for name in ("augmented.nc", "places_2.png", "notes.txt"):
        (tmp_path / name).write_text("earlier")
    document = diagnose_to(few, load_law("constant"), SamplerSettings(), Effort(), tmp_path)
    assert document["verdict"] == "cannot_tell" and "only 4 avalanches" in document["reason"]
    write_reports(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {
        "notes.txt", "report.html", "verdict.json", "diagnosis.nc", "where.png",
    }  # fmt: skip


@pytest.mark.parametrize("with_helpers", [False, True])
def test_draws_are_in_their_files(
    with_helpers: bool, few: HierarchicalProblem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {
        "base.nc": "base", "base_same_errors.nc": "reference", "augmented.nc": "augmented",
        "diagnosis.nc": "curves",
    }  # fmt: skip
    made: dict[str, Any] = {
        name: SimpleNamespace(tree=xr.DataTree(xr.Dataset(attrs={"name": name}))) for name in names.values()
    }
    step: Any = SimpleNamespace(calibration=made["augmented"])
    law = load_law("constant")
    none: Any = None
    added = MechanismsAdded((step,), made["reference"], none)
    found = Diagnosis(few, law, made["base"], none, none, none, none, none, none, added, none)
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.setattr(module, "diagnose", lambda *_: found)
    monkeypatch.setattr(module, "verdict", lambda _: {})
    monkeypatch.setattr(module, "report_facts", lambda _: {})
    monkeypatch.setattr(module, "augmented_draws", lambda _: made["augmented"].tree)
    monkeypatch.setattr(module, "figure_data", lambda _: made["curves"].tree)
    with helpers() if with_helpers else nullcontext():
        diagnose_to(few, law, SamplerSettings(), Effort(), tmp_path)
    told = {
        file.name: xr.open_datatree(file, engine="h5netcdf").attrs["name"] for file in tmp_path.glob("*.nc")
    }
    assert told == names
