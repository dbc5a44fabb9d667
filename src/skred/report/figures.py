"""All figures: of one law's calibration, and of a comparison of laws."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from skred.report.along_track import along_track_figure
from skred.report.chains import joint_figure, marginals_figure, trace_figure
from skred.report.comparing import (
    elpd_figure,
    evidence_figure,
    pareto_k_figure,
    pointwise_figure,
    predictions_figure,
    save_comparison_figures,
)
from skred.report.predictive import predictive_figure
from skred.report.style import write_png

if TYPE_CHECKING:
    import xarray as xr

    from skred.inference.problem import PooledProblem
    from skred.physics.law import Law

__all__ = [
    "along_track_figure",
    "elpd_figure",
    "evidence_figure",
    "joint_figure",
    "marginals_figure",
    "pareto_k_figure",
    "pointwise_figure",
    "predictions_figure",
    "predictive_figure",
    "save_comparison_figures",
    "save_model_figures",
    "trace_figure",
]


def save_model_figures(tree: xr.DataTree, law: Law, problem: PooledProblem, folder: Path) -> list[Path]:
    """Write the figures of one calibration as PNG.

    Parameters
    ----------
    tree : DataTree
        As made by `skred.inference.results.assemble`.
    law : Law
    problem : PooledProblem
        What it was calibrated on.
    folder : Path
        An existing folder.

    Returns
    -------
    list of Path
        trace, joint (laws of two or more parameters), marginals, predictive, along_track.
    """
    files = [write_png(trace_figure(tree, law), folder / "trace.png")]
    if len(law.parameters) > 1:
        files.append(write_png(joint_figure(tree, law), folder / "joint.png"))
    files.append(write_png(marginals_figure(tree, law), folder / "marginals.png"))
    files.append(write_png(predictive_figure(tree, law, problem), folder / "predictive.png"))
    files.append(write_png(along_track_figure(tree, law, problem), folder / "along_track.png"))
    return files
