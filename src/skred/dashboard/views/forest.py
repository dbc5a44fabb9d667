"""Parameters of all runs, side by side."""

from __future__ import annotations

import numpy as np
import xarray as xr
from bokeh.models import ColumnDataSource, FactorRange, HoverTool

from skred.dashboard.figures import new_figure
from skred.dashboard.reading import Given
from skred.dashboard.run import MOST_PARAMETERS, Run
from skred.dashboard.view import Asked, NotShownError, Panel
from skred.report.shared.style import PALETTE

TRUNK, TWIG = 0.5, 0.9
"""Probabilities of the thick and of the thin line, equal-tailed."""


def forest_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """Medians and intervals of each parameter, a line for each run, with a scale of its own.

    A forest of arviz-plots puts all parameters on one scale: ours have different units.
    """
    by_label: dict[str, list[tuple[Run, xr.DataArray]]] = {}
    for one in (one for one in given.runs if one.names):
        for draws in one.parameters(asked.parameters).values():
            by_label.setdefault(str(draws.attrs["label"]), []).append((one, draws))
    if not by_label:
        raise NotShownError("none of the runs has the parameters that were asked for")
    # What several runs share comes first.
    chosen = sorted(by_label, key=lambda label: -len(by_label[label]))[: 2 * MOST_PARAMETERS]
    return [Panel(label, _figure(by_label[label])) for label in chosen]


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
