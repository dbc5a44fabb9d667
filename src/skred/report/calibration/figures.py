"""All figures of one law's calibration."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skred.report.calibration.along_track import along_track_figure
from skred.report.calibration.chains import joint_figure, marginals_figure, trace_figure
from skred.report.calibration.explorations import explorations
from skred.report.calibration.new_avalanches import new_avalanche_figure, new_avalanche_track_figure
from skred.report.calibration.population import events_figure, population_figure
from skred.report.calibration.predictive import predictive_figure
from skred.report.shared.drawing import Picture, draw
from skred.report.shared.law import law_of

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.figure import Figure

_OF_CHAINS = {"trace": trace_figure, "joint": joint_figure, "marginals": marginals_figure}
_POOLED = {"predictive": predictive_figure, "along_track": along_track_figure}
_HIERARCHICAL = {
    "new_avalanche": new_avalanche_figure,
    "population": population_figure,
    "events": events_figure,
    "along_track": new_avalanche_track_figure,
}
MODEL_FIGURES = tuple(dict.fromkeys((*_OF_CHAINS, *_POOLED, *_HIERARCHICAL)))
"""Names of all figures that there may be."""


def save_model_figures(
    tree: xr.DataTree, folder: Path, key: str = "", *, explored: bool = True
) -> dict[str, Picture]:
    """Make the figures of one calibration, and write them as PNG.

    Parameters
    ----------
    tree : DataTree
        As made by `skred.inference.along_track.with_along_track`.
    folder : Path
        An existing folder.
    key : str
        Letters that tell laws apart that stand in one page.
    explored : bool
        Whether they stand in a page, where they can be explored.

    Returns
    -------
    dict of Picture
        trace, joint (where there are two or more parameters), marginals; of a pooled calibration then
        predictive and along_track, of a hierarchical one new_avalanche, population, events and along_track.
    """
    law = law_of(tree)
    makers: dict[str, Callable[[xr.DataTree], Figure]] = dict(_OF_CHAINS)
    if len(law.parameters) < 2:
        del makers["joint"]
    makers |= _HIERARCHICAL if law.likelihood == "hierarchical" else _POOLED
    drawn = {name: partial(make, tree) for name, make in makers.items()}
    return draw(drawn, folder, key, explorations(tree) if explored else None)
