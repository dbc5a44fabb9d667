"""All figures: of one law's calibration, and of a comparison of laws."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from skred.report.calibration.along_track import along_track_figure
from skred.report.calibration.chains import joint_figure, marginals_figure, trace_figure
from skred.report.calibration.new_avalanches import new_avalanche_figure, new_avalanche_track_figure
from skred.report.calibration.population import events_figure, population_figure
from skred.report.calibration.predictive import predictive_figure
from skred.report.comparison.laws import (
    elpd_figure,
    evidence_figure,
    pareto_k_figure,
    pointwise_figure,
    save_comparison_figures,
)
from skred.report.comparison.sensors import predictions_figure
from skred.report.shared.style import write_png

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.figure import Figure

    from skred.inference.pooled.problem import PooledProblem
    from skred.inference.problem import Problem
    from skred.physics.law import Law

__all__ = [
    "along_track_figure",
    "elpd_figure",
    "events_figure",
    "evidence_figure",
    "joint_figure",
    "marginals_figure",
    "new_avalanche_figure",
    "new_avalanche_track_figure",
    "pareto_k_figure",
    "pointwise_figure",
    "population_figure",
    "predictions_figure",
    "predictive_figure",
    "save_comparison_figures",
    "save_model_figures",
    "trace_figure",
]


def save_model_figures(tree: xr.DataTree, law: Law, problem: Problem, folder: Path) -> list[Path]:
    """Write the figures of one calibration as PNG.

    Parameters
    ----------
    tree : DataTree
        As made by `skred.inference.results.assemble`.
    law : Law
    problem : Problem
        What it was calibrated on.
    folder : Path
        An existing folder.

    Returns
    -------
    list of Path
        trace, joint (where there are two or more parameters), marginals; of a pooled calibration then
        predictive and along_track, of a hierarchical one new_avalanche, population, events and along_track.
    """
    parameters = problem.parameters(law)
    makers: dict[str, Callable[[], Figure]] = {"trace": partial(trace_figure, tree, law, parameters)}
    if len(parameters) > 1:
        makers["joint"] = partial(joint_figure, tree, law, parameters)
    makers["marginals"] = partial(marginals_figure, tree, law, parameters)
    if problem.likelihood == "hierarchical":
        makers["new_avalanche"] = partial(new_avalanche_figure, tree, law, problem)
        makers["population"] = partial(population_figure, tree, law, problem)
        makers["events"] = partial(events_figure, tree, law, problem)
        makers["along_track"] = partial(new_avalanche_track_figure, tree, law, problem)
    else:
        pooled = cast("PooledProblem", problem)
        makers["predictive"] = partial(predictive_figure, tree, law, pooled)
        makers["along_track"] = partial(along_track_figure, tree, law, pooled)
    return [write_png(make(), folder / f"{name}.png") for name, make in makers.items()]
