"""The page of a scorecard: one HTML file that needs nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from skred.report.scorecard.sections import sections_of
from skred.report.shared.document import Document, get, listed
from skred.report.shared.html import environment, picture


def render_scorecard(document: Document, figures: Mapping[str, Path]) -> str:
    """Render the page of a scorecard.

    Parameters
    ----------
    document : mapping
        As made by `skred.prove.scorecard.scorecard`.
    figures : mapping of str to Path
        PNG files by name, see `skred.report.scorecard.figures.save_scorecard_figures`.

    Returns
    -------
    str
        A self-contained page: style inside, pictures as data URIs.
    """
    return (
        environment()
        .get_template("scorecard.html.jinja")
        .render(
            d=document,
            sections=sections_of(document),
            figures={name: picture(file) for name, file in figures.items()},
            called=Counter(bar["status"] for bar in listed(document, "bars")),
            ledger=get(document, "ledger") or {},
        )
    )
