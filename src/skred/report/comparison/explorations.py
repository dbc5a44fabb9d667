"""What can be explored of a comparison: the plots of ArviZ of what its figures draw.

Differences avalanche by avalanche, the order without some of them, means at the sensors and the evidence have
none: ArviZ has no plot of these numbers. What it draws of a law's draws is explored with that law.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from skred.report.comparison.pit import places_by_sensor
from skred.report.shared.document import Document, get, listed, pareto_k_limit, ranked
from skred.report.shared.drawing import Exploration
from skred.report.shared.labels import shortened
from skred.report.shared.numbers import floats, is_number

if TYPE_CHECKING:
    from skred.report.explore.panel import Panel


_MOST_PLACES = 24
"""Sensors under laws that are shown."""


def explorations(comparison: Document) -> dict[str, Callable[[], Exploration | None]]:
    """Makers of explorations by the name of the figure.

    Parameters
    ----------
    comparison : mapping
        The content of ``compare.json``.
    """
    from skred.report.explore.exploration import Plot, exploration
    from skred.report.explore.plots import compare, loo_pit, pareto_k

    alone = {"Difference of elpd": ranked(comparison)}
    both = {
        "Every avalanche its own friction": ranked(comparison),
        "Pooled: one friction for the path": ranked(get(comparison, "pooled") or {}),
    }
    plots = {
        "comparison_elpd": Plot("plot_compare", compare.HOW, partial(_differences, alone)),
        "likelihoods": Plot("plot_compare", compare.HOW, partial(_differences, both)),
        "pareto_k": Plot("plot_khat", pareto_k.HOW, partial(_pareto_k, comparison)),
        "loo_pit": Plot("plot_ecdf_pit", loo_pit.HOW, partial(_pit, comparison)),
    }
    return {name: partial(exploration, plot) for name, plot in plots.items()}


def _differences(of: dict[str, list[Document]]) -> list[Panel]:
    """A comparison for each likelihood: the differences of its laws to the best of them."""
    import pandas as pd

    from skred.report.explore.panel import Panel
    from skred.report.explore.plots.compare import difference_figure

    panels = []
    for title, laws in of.items():
        known = [law for law in laws if all(is_number(get(law, "difference", k)) for k in ("elpd", "se"))]
        if len(known) < 2:
            continue
        names = [str(number) for number in range(len(known))]
        table = pd.DataFrame(
            {
                "elpd_diff": floats([get(law, "difference", "elpd") for law in known]),
                "dse": floats([get(law, "difference", "se") for law in known]),
            },
            index=names,
        )
        words = {name: shortened(get(law, "id"), 24) for name, law in zip(names, known, strict=True)}
        panels.append(Panel(title, difference_figure(table, words)))
    return panels


def _pareto_k(comparison: Document) -> list[Panel]:
    """Pareto k of each event, a figure a law."""
    from skred.report.explore.plots.pareto_k import loo_of, pareto_panel

    events, limit = [str(one) for one in listed(comparison, "event_ids")], pareto_k_limit(comparison)
    return [
        pareto_panel(loo_of(floats(found), limit), events, f"Pareto k under {shortened(get(law, 'id'), 24)}")
        for law in ranked(comparison)
        if len(found := listed(law, "loo", "pareto_k")) == len(events) > 0
    ]


def _pit(comparison: Document) -> list[Panel]:
    """Places of the readings in their predictions, a figure for each sensor and law."""
    from skred.report.explore.plots.ecdf_pit import pit_panel

    found = places_by_sensor(comparison)
    left = f"The first {_MOST_PLACES} of {len(found)} figures." if len(found) > _MOST_PLACES else ""
    return [
        pit_panel(
            f"{shortened(sensor, 30)} under {shortened(law, 24)}", places.events, places.spread, note=left
        )
        for sensor, law, places in found[:_MOST_PLACES]
    ]
