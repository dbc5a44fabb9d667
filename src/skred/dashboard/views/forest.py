"""Parameters of all runs, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from bokeh.models import ColumnDataSource, FactorRange, HoverTool

from skred.dashboard.each import Failures
from skred.dashboard.parameters import common_parameters
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.figures import new_figure
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.run import Run
from skred.report.shared.style import PALETTE

MOST_SHOWN = 24
"""Parameters, each a small panel."""
TRUNK, TWIG = 0.5, 0.9
"""Probabilities of the thick and of the thin line, equal-tailed."""


def forest_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """Medians and intervals of each parameter, a line for each run, with a scale of its own.

    A forest of arviz-plots puts all parameters on one scale: ours have different units.
    """
    failures = Failures()
    rows_of = common_parameters(given.runs, failures)
    chosen = [label for label in asked.parameters if label in rows_of] or list(rows_of)[:MOST_SHOWN]
    if not chosen:
        raise NotShownError("none of the runs has the parameters that were asked for")
    wanted: dict[Run, list[str]] = {}
    for label in chosen:
        for one, own in rows_of[label]:
            wanted.setdefault(one, []).append(own)
    drawn = dict(failures.of_each(wanted, lambda one: _draws(one, wanted[one])))
    panels = []
    for label in chosen:
        rows = [(one, drawn[one][own]) for one, own in rows_of[label] if one in drawn]
        if rows:
            panels.append(Panel(label, _figure(rows)))
    return panels + failures.panels()


def _draws(run: Run, labels: Sequence[str]) -> dict[str, xr.DataArray]:
    """Draws of some parameters by their labels."""
    return {str(one.attrs["label"]): one for one in run.parameters(labels, most=len(labels)).values()}


def _figure(rows: list[tuple[Run, xr.DataArray]]) -> object:
    names = [str(run.number) for run, _ in rows]
    tails = [(1 - TWIG) / 2, (1 - TRUNK) / 2, 0.5, (1 + TRUNK) / 2, (1 + TWIG) / 2]
    ends = np.array([np.nanquantile(draws.values, tails) for _, draws in rows])
    source = ColumnDataSource(
        {
            "run": names,
            "title": [run.title for run, _ in rows],
            "colour": [PALETTE[(run.number - 1) % len(PALETTE)] for run, _ in rows],
            **{key: ends[:, k] for k, key in enumerate(("twig0", "trunk0", "median", "trunk1", "twig1"))},
        }
    )
    made = new_figure(
        str(rows[0][1].attrs["axis"]),
        "run",
        height=110 + 26 * len(rows),
        y_range=FactorRange(factors=names[::-1]),
    )
    made.hbar("run", left="twig0", right="twig1", height=0.06, source=source, color="colour")
    made.hbar("run", left="trunk0", right="trunk1", height=0.22, source=source, color="colour")
    dots = made.scatter("median", "run", source=source, size=9, fill_color="white", line_color="colour",
                        line_width=2)  # fmt: skip
    tips = [("run", "@title"), ("median", "@median{0.0000}"), ("90 %", "@twig0{0.0000} to @twig1{0.0000}")]
    made.add_tools(HoverTool(renderers=[dots], tooltips=tips))
    made.ygrid.visible = False
    return made
