"""A diagnosis with its documents: verdict.json, and draws, curves and predictions as netCDF."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from skred.diagnosis.clock import Tell
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import Effort
from skred.diagnosis.outcome import NotDiagnosed, Outcome
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.repeated import folds_of, open_locked, outer_folds, set_aside
from skred.diagnosis.verdict.document import verdict
from skred.diagnosis.verdict.draws import augmented_draws, profile_draws
from skred.diagnosis.verdict.figure_data import figure_data
from skred.diagnosis.verdict.report_facts import report_facts
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.output import write_json
from skred.parallel.processes import meanwhile
from skred.physics.law import Law

DRAWS = ("base.nc", "base_same_errors.nc", "augmented.nc", "profile.nc")
"""Of the base law, of it under the errors of what was added, of the law with that, and of the law with a
force that is in no list."""
CURVES = "diagnosis.nc"
"""What the figures show, see `skred.diagnosis.verdict.figure_data`."""


def diagnose_to(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    effort: Effort,
    folder: Path,
    tell: Tell = lambda line: None,
    *,
    lock: int = 0,
    folds: int = 0,
) -> dict[str, Any]:
    """Diagnose, and write all documents into a folder; the verdict first, so that it is there in any case.

    Page and figures are made from the documents, see `skred.report.folders.write_reports`.

    Parameters
    ----------
    lock : int
        Avalanches set aside before anything is looked at, and opened once at the end.
    folds : int
        Parts of the others without which the whole diagnosis is repeated, one by one; 0 for none.
    """
    locked = None
    if lock:
        problem, locked = set_aside(problem, lock, settings.seed)
    if folds:
        folds_of(problem, folds, settings.seed)  # refused now rather than after the diagnosis
    found = diagnose(problem, law, settings, effort, tell)
    document = verdict(found) | {
        "settings": settings.as_dict(),
        "report": report_facts(found),
    }
    # Not all of these are written each time: an earlier diagnosis's would be taken for this one's.
    for name in ("verdict.json", CURVES, *DRAWS):
        (folder / name).unlink(missing_ok=True)
    write_json(folder / "verdict.json", document)
    if locked is not None:
        tell(f"opening {lock} locked avalanches")
        document["locked"] = open_locked(found, locked, settings.seed)
    if folds:
        without = replace(effort, exact_loo=False)
        document["outer_folds"] = outer_folds(
            problem, folds, settings.seed, lambda others: diagnose(others, law, settings, without), tell
        )
    if lock or folds:
        write_json(folder / "verdict.json", document)
    write_trees(found, folder)
    return document


def write_trees(found: Outcome, folder: Path) -> None:
    """Write draws of every calibration and what the figures show, each whatever becomes of the others.

    ``diagnosis.nc`` is always there, ``base.nc`` where the base law was calibrated, ``augmented.nc`` where
    mechanisms were added, ``base_same_errors.nc`` where that was under other errors than those of the base,
    ``profile.nc`` where a force was added that is in no list.
    """
    with ExitStack() as saved:
        for name, tree in (_draws_of(found) | {CURVES: figure_data(found)}).items():
            saved.callback(meanwhile(save, tree, folder / name))


def _draws_of(found: Outcome) -> dict[str, xr.DataTree]:
    """Draws of every calibration of a diagnosis, by the name of their file."""
    trees = {} if found.calibration is None else {"base.nc": found.calibration.tree}
    if not isinstance(found, NotDiagnosed) and found.steps:
        if found.reference is not found.calibration:
            trees["base_same_errors.nc"] = found.reference.tree
        trees["augmented.nc"] = augmented_draws(found)
    if not isinstance(found, NotDiagnosed) and isinstance(found.finding, ProfileLaw):
        trees["profile.nc"] = profile_draws(found, found.finding)
    return trees
