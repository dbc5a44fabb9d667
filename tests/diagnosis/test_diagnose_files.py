"""What a diagnosis leaves in its folder."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr
from diagnosis_cases import gates_campaign, gates_diagnosis

from skred.campaign.parts import of_events
from skred.diagnosis.augment.step import Augmented
from skred.diagnosis.effort import Effort
from skred.diagnosis.run import diagnose_to, write_trees
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


@pytest.mark.parametrize("with_helpers", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_draws_are_in_their_files(
    with_helpers: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a biased sensor that was found, and the base law calibrated once more for comparison."""
    found = gates_diagnosis(biased=True)
    assert isinstance(found.finding, Augmented)
    other = replace(found.calibration, tree=found.calibration.tree.copy())
    other.tree.attrs["name"] = "under the same errors"
    added = replace(found, finding=replace(found.finding, reference=other))
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    first, alone = tmp_path / "first", tmp_path / "alone"
    first.mkdir()
    alone.mkdir()
    with helpers() if with_helpers else nullcontext():
        write_trees(added, first)
        write_trees(found, alone)
    trees = {file.name: xr.open_datatree(file, engine="h5netcdf") for file in first.iterdir()}
    assert set(trees) == {"base.nc", "base_same_errors.nc", "augmented.nc", "diagnosis.nc"}
    assert "name" not in trees["base.nc"].attrs
    assert trees["base_same_errors.nc"].attrs["name"] == "under the same errors"
    own = {str(name) for name in trees["base.nc"]["posterior"].data_vars}
    assert own < {str(name) for name in trees["augmented.nc"]["posterior"].data_vars}
    assert "added" in trees["augmented.nc"].children and "added" not in trees["base.nc"].children
    assert "posterior" not in trees["diagnosis.nc"].children
    # What is not there is not written.
    assert {file.name for file in alone.iterdir()} == {"base.nc", "augmented.nc", "diagnosis.nc"}


def test_draws_of_nothing_are_not_written(tmp_path: Path) -> None:
    write_trees(gates_diagnosis(biased=False), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"base.nc", "diagnosis.nc"}


@pytest.mark.slow
def test_locked_avalanches_and_folds_are_in_the_verdict(tmp_path: Path) -> None:
    """The diagnosis is repeated without each fold of those that are not locked."""
    problem = hierarchical_problem(gates_campaign(range(16), biased=True))
    settings, effort = SamplerSettings("metropolis", 300, 300, 4, 0), Effort(max_mechanisms=1)
    diagnose_to(problem, load_law("constant"), settings, effort, tmp_path, lock=3, folds=2)
    document = json.loads((tmp_path / "verdict.json").read_text())
    locked, folds = document["locked"]["events"], document["outer_folds"]["folds"]
    assert len(locked) == 3 and len(folds) == 2
    others = [event for fold in folds for event in fold["events"]]
    assert sorted([*locked, *others]) == sorted(problem.campaign.event_ids)
    assert document["mechanism"] == "sensor_bias" == folds[0]["mechanism"] == folds[1]["mechanism"]
    assert document["locked"]["elpd_diff"] > 0.0 and document["outer_folds"]["elpd_diff"] > 0.0
