"""The page of a scorecard: one HTML file that needs nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING

from skred.report.scorecard.lay import lay_words
from skred.report.scorecard.sections import sections_of
from skred.report.shared.document import Document, get, listed
from skred.report.shared.html import page

if TYPE_CHECKING:
    from skred.report.shared.drawing import Picture


def render_scorecard(document: Document, figures: Mapping[str, Picture]) -> str:
    """Render the page of a scorecard.

    Parameters
    ----------
    document : mapping
        As made by `skred.prove.scorecard.scorecard`.
    figures : mapping of str to Picture
        By name, see `skred.report.scorecard.figures.save_scorecard_figures`.

    Returns
    -------
    str
        A self-contained page, see `skred.report.shared.html.page`.
    """
    return page(
        "scorecard.html.jinja",
        figures,
        d=document,
        sections=sections_of(document),
        lay=lay_words(document),
        called=Counter(bar["status"] for bar in listed(document, "bars")),
        ledger=get(document, "ledger") or {},
    )
