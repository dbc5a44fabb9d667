"""A diagnosis with its files: verdict.json, report.html, base.nc, augmented.nc and figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from skred.diagnosis.diagnose import Effort, diagnose
from skred.diagnosis.verdict import verdict
from skred.inference.hierarchical import HierarchicalProblem
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.physics.law import Law
from skred.work.output import write_json, write_text

Tell = Callable[[str], None]


def diagnose_to(
    problem: HierarchicalProblem,
    law: Law,
    settings: SamplerSettings,
    effort: Effort,
    folder: Path,
    tell: Tell = lambda line: None,
) -> dict[str, Any]:
    """Diagnose, and write everything into a folder; the verdict first, so that it is there in any case."""
    from skred.report.diagnosis import render_diagnosis, save_diagnosis_figures

    found = diagnose(problem, law, settings, effort, tell)
    document = verdict(found) | {"settings": settings.as_dict() | {"replicas": effort.replicas}}
    write_json(folder / "verdict.json", document)
    if found.calibration is not None:
        save(found.calibration.tree, folder / "base.nc")
    if found.reference is not None and found.reference is not found.calibration:
        save(found.reference.tree, folder / "base_same_errors.nc")
    if found.steps:
        save(found.steps[-1].calibration.tree, folder / "augmented.nc")
    tell("writing the report")
    figures = save_diagnosis_figures(found, folder)
    write_text(folder / "report.html", render_diagnosis(found, document, figures))
    return document
