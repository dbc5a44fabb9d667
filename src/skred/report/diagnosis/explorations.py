"""What can be explored of a diagnosis: the plots of ArviZ of what its figures draw.

Probabilities, forces along the track, evidence by place, avalanches left out and what the answer hangs on
have none: ArviZ has no plot of these, or needs draws where a diagnosis keeps intervals.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from skred.report.diagnosis.evidence import group_of
from skred.report.diagnosis.words import comparisons, with_added
from skred.report.shared import document as doc
from skred.report.shared.drawing import Exploration
from skred.report.shared.labels import name_text, symbol_text, unit_text

if TYPE_CHECKING:
    import xarray as xr

    from skred.report.explore.panel import Panel


def explorations(document: doc.Document, tree: xr.DataTree) -> dict[str, Callable[[], Exploration | None]]:
    """Makers of explorations by the name of the figure.

    Parameters
    ----------
    document : mapping
        The content of ``verdict.json``.
    tree : DataTree
        The content of ``diagnosis.nc``.
    """
    from skred.report.explore.exploration import Plot, exploration
    from skred.report.explore.plots import draws, tstat

    plots = {
        group_of("strength", k): Plot("plot_dist", draws.HOW, partial(_added, document, tree, k))
        for k, _ in enumerate(comparisons(document))
    }
    plots["check"] = Plot("plot_ppc_tstat", tstat.HOW, partial(_checks, document, tree))
    return {name: partial(exploration, plot) for name, plot in plots.items()}


def _checks(document: doc.Document, tree: xr.DataTree) -> list[Panel]:
    """The statistic of clean campaigns and of the recordings, for each law that can be drawn."""
    from skred.report.explore.panel import NotShownError

    panels = []
    for number in range(tree["check"].sizes["law"]):
        with suppress(NotShownError):
            panels.append(_check(document, tree, number))
    return panels


def _check(document: doc.Document, tree: xr.DataTree, number: int) -> Panel:
    """The statistic of clean campaigns and of the recordings, for one law."""
    from skred.report.explore.plots.tstat import statistic_panel

    found = tree["check"].to_dataset().isel(law=number)
    checks = doc.listed(document, "report", "checks")
    added = doc.listed(checks[number] if number < len(checks) else {}, "added")
    label = "log odds of anything against nothing [nats]"
    recorded = float(found["statistic"])
    return statistic_panel(with_added(document, added), label, np.ravel(found["simulated"]), recorded)


def _added(document: doc.Document, tree: xr.DataTree, number: int) -> list[Panel]:
    """The posterior of the coefficient that was added from a comparison."""
    from skred.report.explore.plots.draws import draws_panel

    added, comparison = doc.listed(document, "report", "added"), comparisons(document)[number]
    if doc.get(comparison, "added") is None or "added" not in tree.children or number >= len(added):
        return []
    one = added[number]
    name = str(doc.get(one, "parameter"))
    words = f"{name_text(name)} {symbol_text(doc.get(one, 'symbol') or '')}".strip()
    return [
        draws_panel(
            tree["added"][name].transpose("chain", "draw"),
            f"Coefficient {words}: calibrated with all else",
            f"{words} [{unit_text(doc.get(one, 'unit') or '1')}]",
        )
    ]
