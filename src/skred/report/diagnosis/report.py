"""The report of a diagnosis: figures, a page that needs nothing else, and a table for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skred.report.diagnosis.evidence import check_figure, probabilities_figure, strength_figure
from skred.report.diagnosis.flat import flat
from skred.report.diagnosis.held_out import left_out_figure, scores_figure
from skred.report.diagnosis.places import local_names, places_figure, where_figure
from skred.report.diagnosis.terminal import diagnosis_table
from skred.report.diagnosis.words import comparisons
from skred.report.shared import document as doc
from skred.report.shared.style import write_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from skred.diagnosis.outcome import Outcome

__all__ = ["FIGURES", "diagnosis_table", "render_diagnosis", "save_diagnosis_figures"]
_OF_RACES = ("probabilities", "strength", "places")
FIGURES = ("check", "where", *_OF_RACES, *(f"{name}_2" for name in _OF_RACES), "left_out", "scores")
"""Names of all figures that there may be."""


def save_diagnosis_figures(outcome: Outcome, folder: Path) -> dict[str, Path]:
    """Write the figures of a diagnosis as PNG.

    Parameters
    ----------
    outcome : Outcome
    folder : Path
        An existing folder.

    Returns
    -------
    dict of str to Path
        Those of `FIGURES` that apply; with _2 those of a second comparison.
    """
    found = flat(outcome)
    makers: dict[str, Callable[[], Figure]] = {}
    if found.check is not None:
        makers["check"] = partial(check_figure, found)
    makers["where"] = partial(where_figure, found)
    for number, comparison in enumerate(comparisons(found)):
        ending = f"_{number + 1}" if number else ""
        makers[f"probabilities{ending}"] = partial(probabilities_figure, found, comparison, number)
        makers[f"strength{ending}"] = partial(strength_figure, found, comparison, number)
        if local_names(comparison):
            makers[f"places{ending}"] = partial(places_figure, found, comparison, number)
    if found.before is not None:
        makers["left_out"] = partial(left_out_figure, found)
    if found.before is not None and found.after is not None:
        makers["scores"] = partial(scores_figure, found)
    return {name: write_png(make(), folder / f"{name}.png") for name, make in makers.items()}


def render_diagnosis(outcome: Outcome, document: doc.Document, figures: Mapping[str, Path]) -> str:
    """Render the report of a diagnosis.

    Parameters
    ----------
    outcome : Outcome
    document : mapping
        The verdict that is also written as ``verdict.json``.
    figures : mapping of str to Path
        As `save_diagnosis_figures` returns them; what is missing is left out.

    Returns
    -------
    str
        A self-contained page: style inside, pictures as data URIs.
    """
    from skred.report.diagnosis.page import page

    return page(flat(outcome), document, figures)
