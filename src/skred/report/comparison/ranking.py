"""What would change a ranking: its figure, and the rows of its tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.comparison.parts import law_axis, practical_band, styles
from skred.report.shared.document import Document, get, listed, models
from skred.report.shared.labels import figure_text, printable
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats, is_number, whole
from skred.report.shared.style import GREY, legend_below, new_figure, side_by_side, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SCHEMES = {
    "exact": "leave-one-event-out (decides)",
    "loo": "LOO, importance sampling alone",
    "waic": "WAIC",
    "evidence": "evidence",
}


def rivals(comparison: Document) -> list[Document]:
    """What is known of each law behind the best; those whose numbers are all there."""
    return [
        one
        for one in listed(comparison, "ranking", "rivals")
        if is_number(get(one, "difference")) and all(map(is_number, _without_each(one)))
    ]


def _without_each(one: Document) -> list[Any]:
    return [get(part, "difference") for part in listed(one, "without_each")]


@styled
def ranking_figure(comparison: Document) -> Figure | None:
    """The difference to the best law without each avalanche, and without more and more of them."""
    shown = rivals(comparison)
    if not shown:
        return None
    best = figure_text(get(comparison, "ranking", "best"), 24)
    title = f"What the order hangs on: difference to {best} without some of the avalanches"
    figure = new_figure(2.4 + 0.3 * len(shown), title)
    single, several = side_by_side(figure, 2)
    _without_one(single, comparison, shown)
    _without_several(several, comparison, shown)
    legend_below(figure, (single, several), columns=3)
    return figure


def _without_one(axes: Axes, comparison: Document, shown: list[Document]) -> None:
    """A row a law: all avalanches, and all but one."""
    colours, markers = styles(comparison)
    practical_band(axes, comparison)
    for row, one in enumerate(shown):
        law = str(get(one, "id"))
        parts = listed(one, "without_each")
        values = floats(_without_each(one))
        axes.plot(
            values, np.full(len(values), row), linestyle="none", marker="|", markersize=9, color=colours[law]
        )
        axes.plot(get(one, "difference"), row, marker=markers[law], color=colours[law], markersize=6)
        events = [str(get(part, "event")) for part in parts]
        told = [
            f"without {event}: {law} {fixed(v)} nats"
            for event, v in zip(events, values.tolist(), strict=True)
        ]
        mark(axes, values, row, told, events)
    axes.plot([], [], linestyle="none", marker="|", markersize=9, color=GREY, label="without one avalanche")
    axes.plot([], [], linestyle="none", marker="o", markersize=6, color=GREY, label="with all")
    law_axis(axes, [{"id": get(one, "id")} for one in shown])
    axes.set_xlabel("difference of elpd, without one [nats]")


def _without_several(axes: Axes, comparison: Document, shown: list[Document]) -> None:
    """The difference as avalanches go that favour the best law most, one after the other."""
    colours, markers = styles(comparison)
    for one in shown:
        law = str(get(one, "id"))
        total = float(get(one, "difference"))
        parts = sorted(listed(one, "without_each"), key=lambda part: -get(part, "difference"))
        lead = floats([get(part, "difference") for part in parts]) - total
        left = np.concatenate([[total], total + np.cumsum(lead)])
        steps = np.arange(len(left) - 1)  # without all of them there is nothing
        colour = colours[law]
        axes.plot(
            steps,
            left[:-1],
            color=colour,
            linewidth=1.0,
            marker=markers[law],
            markersize=3,
            label=figure_text(law, 24),
        )
        told = [
            f"{law}: without {n} avalanche{'' if n == 1 else 's'} {fixed(v)} nats"
            for n, v in enumerate(left[:-1].tolist())
        ]
        mark(axes, steps, left[:-1], told)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_xlabel("avalanches left out, those first\nthat favour the best law most")
    axes.set_ylabel("difference of elpd [nats]")


def rival_rows(comparison: Document) -> list[dict[str, Any]]:
    """For each law behind the best: how firm that is, as text."""
    n = len(listed(comparison, "event_ids"))
    rows = []
    for one in listed(comparison, "ranking", "rivals"):
        values = [value for value in _without_each(one) if is_number(value)]
        reversed_by, not_without = get(one, "reversed_without"), get(one, "counts_not_without")
        ends = [fixed(f(values)) for f in (min, max)] if values else []
        rows.append(
            {
                "id": printable(get(one, "id")),
                "difference": f"{fixed(get(one, 'difference'))} ± {fixed(get(one, 'se'))}",
                "ratio": fixed(get(one, "ratio"), 1),
                "counts": {True: "yes", False: "no"}.get(get(one, "counts"), "n/a"),
                "evidence": fixed(get(one, "evidence_difference")),
                "range": " to ".join(ends) or "n/a",
                "reversed": f"{len(reversed_by)} of {n}" if reversed_by else "-",
                "not_without": f"{len(not_without)} of {n}" if not_without else "-",
                "needed": whole(get(one, "events_needed")) if is_number(get(one, "events_needed")) else "-",
                "reversed_by": [printable(event) for event in reversed_by or []],
            }
        )
    return rows


def order_rows(comparison: Document) -> list[dict[str, Any]]:
    """Laws in the order of each score, and whether it is that of the score that decides."""
    orders = get(comparison, "ranking", "orders") or {}
    decides = orders.get("exact")
    return [
        {
            "scheme": words,
            "order": ", ".join(map(printable, orders[name])),
            "same": "-" if name == "exact" else "yes" if orders[name] == decides else "no",
        }
        for name, words in _SCHEMES.items()
        if orders.get(name)
    ]


def event_rows(comparison: Document) -> dict[str, Any]:
    """One row an avalanche: its score by the best law, the others' differences, and Pareto k by law.

    Returns
    -------
    dict
        ``laws``: ids; ``rows``: of ``event``, ``best``, ``differences`` and ``k``; empty without scores.
    """
    events = listed(comparison, "event_ids")
    laws = [
        law
        for law in models(comparison)
        if len(listed(law, "exact", "pointwise")) == len(events) == len(listed(law, "loo", "pareto_k"))
    ]
    if not laws or not events:
        return {"laws": [], "rows": []}
    scores = [floats(listed(law, "exact", "pointwise")) for law in laws]
    rows = [
        {
            "event": printable(event),
            "best": fixed(float(scores[0][k])),
            "differences": [fixed(float(one[k] - scores[0][k]), signed=True) for one in scores[1:]],
            "k": [fixed(listed(law, "loo", "pareto_k")[k]) for law in laws],
            "refitted": [event in listed(law, "exact", "refitted") for law in laws],
        }
        for k, event in enumerate(events)
    ]
    return {"laws": [printable(get(law, "id")) for law in laws], "rows": rows}
