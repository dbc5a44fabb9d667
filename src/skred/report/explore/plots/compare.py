"""Differences of elpd to the best of some runs or laws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from bokeh.models import GlyphRenderer, Scatter

from skred.report.explore.figures import plain, quietly, styled

if TYPE_CHECKING:
    import pandas as pd

HOW = "Lines: one standard error, not doubled. Left of the dashed line: worse than the best."
"""How to read it."""


def difference_figure(table: pd.DataFrame, words: Mapping[str, str]) -> Any:
    """Each difference with its standard error, by arviz-plots.

    Parameters
    ----------
    table : DataFrame
        As `arviz.compare` returns it; of it ``elpd_diff`` and ``dse`` are drawn.
    words : mapping of str
        What each row is called.
    """
    import arviz_plots as azp

    with quietly():
        made = azp.plot_compare(table, backend="bokeh").viz["plot"].item()
    made.xaxis.axis_label = "difference of elpd to the best [nats]"
    named = made.yaxis[0].major_label_overrides.items()
    made.yaxis[0].major_label_overrides = {at: plain(words[str(name)]) for at, name in named}
    for renderer in made.renderers:
        if isinstance(renderer, GlyphRenderer) and isinstance(renderer.glyph, Scatter):
            renderer.glyph.size = 8
        elif isinstance(renderer, GlyphRenderer):
            renderer.glyph.line_width = 2
    return styled(made, height=120 + 40 * len(table), title="")
