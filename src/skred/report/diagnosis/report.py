"""The report of a diagnosis: figures, a page that needs nothing else, and a table for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skred.report.diagnosis.check import check_figure
from skred.report.diagnosis.conditional import conditional_figure, conditional_kinds
from skred.report.diagnosis.evidence import group_of, probabilities_figure, strength_figure
from skred.report.diagnosis.explorations import explorations
from skred.report.diagnosis.held_out import is_compared, left_out_figure, scores_figure
from skred.report.diagnosis.influence import has_influence, influence_figure
from skred.report.diagnosis.places import places_figure, places_of, where_figure
from skred.report.diagnosis.terminal import diagnosis_table
from skred.report.diagnosis.words import comparisons, leading_name
from skred.report.shared import document as doc
from skred.report.shared.drawing import Picture, draw

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["FIGURES", "diagnosis_table", "render_diagnosis", "save_diagnosis_figures"]
_OF_COMPARISONS = ("probabilities", "strength", "places")
FIGURES = (
    "conditional_speeds", "conditional_runouts", "check", "where",
    *_OF_COMPARISONS, *(f"{name}_2" for name in _OF_COMPARISONS), "left_out", "scores", "influence",
)  # fmt: skip
"""Names of all figures that there may be."""


def save_diagnosis_figures(document: doc.Document, tree: xr.DataTree, folder: Path) -> dict[str, Picture]:
    """Make the figures of a diagnosis, and write them as PNG.

    Parameters
    ----------
    document : mapping
        The content of ``verdict.json``; anything may be null.
    tree : DataTree
        The content of ``diagnosis.nc``.
    folder : Path
        An existing folder.

    Returns
    -------
    dict of str to Picture
        Those of `FIGURES` that apply; with _2 those of a second comparison.
    """
    makers: dict[str, Callable[[], Figure | None]] = {}
    if "check" in tree.children:
        makers["check"] = partial(check_figure, document, tree)
    makers["where"] = partial(where_figure, document, tree)
    for number, comparison in enumerate(comparisons(document)):
        makers[group_of("probabilities", number)] = partial(
            probabilities_figure, document, comparison, number
        )
        if _has_curve(tree, comparison, number):
            makers[group_of("strength", number)] = partial(strength_figure, document, tree, number)
        if places_of(tree, number):
            makers[group_of("places", number)] = partial(places_figure, document, tree, number)
    for kind in conditional_kinds(tree):
        makers[f"conditional_{kind}"] = partial(conditional_figure, document, tree, kind)
    if "held_out" in tree.children:
        makers["left_out"] = partial(left_out_figure, tree)
    if is_compared(tree):
        makers["scores"] = partial(scores_figure, tree)
    if has_influence(document):
        makers["influence"] = partial(influence_figure, document)
    return draw(makers, folder, explorations=explorations(document, tree))


def _has_curve(tree: xr.DataTree, comparison: doc.Document, number: int) -> bool:
    """Whether the leading candidate's evidence along its coefficient is known."""
    group = group_of("comparison", number)
    return group in tree.children and leading_name(comparison) in tree[group].to_dataset()["candidate"].values


def render_diagnosis(document: doc.Document, tree: xr.DataTree, figures: Mapping[str, Picture]) -> str:
    """Render the report of a diagnosis.

    Parameters
    ----------
    document : mapping
        The content of ``verdict.json``; anything may be null.
    tree : DataTree
        The content of ``diagnosis.nc``.
    figures : mapping of str to Picture
        As `save_diagnosis_figures` returns them; what is missing is left out.

    Returns
    -------
    str
        A self-contained page, see `skred.report.shared.html.page`.
    """
    from skred.report.diagnosis.page import page

    return page(document, tree, figures)
