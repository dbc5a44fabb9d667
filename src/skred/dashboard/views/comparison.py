"""Runs compared by leaving events out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from skred.dashboard.comparable import Comparable, comparable
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.figures import legend_above, new_figure, points, quietly
from skred.report.explore.panel import Panel
from skred.report.explore.plots.compare import difference_figure
from skred.report.explore.plots.pareto_k import name_events
from skred.report.explore.run import Run
from skred.report.shared.style import MARKERS, PALETTE

_BOKEH_MARKERS = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle", "v": "inverted_triangle",
                  "P": "plus"}  # fmt: skip


def comparison_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """A table and a figure of `arviz.compare` for each set of runs that predict the same, and the events."""
    found = comparable(given.runs)
    panels = [panel for runs in found.sets for panel in _panels(runs)]
    if found.others:
        panels.append(_others(found))
    return panels


def _others(found: Comparable) -> Panel:
    """Runs that are compared with none, and why."""
    rows = Markup("").join(
        Markup("<li>run {}, {}: {}</li>").format(run.number, run.title, why) for run, why in found.others
    )
    note = "Compared are runs of the same observations with the same likelihood."
    if not found.sets:
        note += " Give the folders of two laws, or one of skred compare."
    title = "Not compared" if found.sets else "No two of the runs can be compared"
    return Panel(title, html=str(Markup("<ul>{}</ul>").format(rows)), note=note, wide=True)


def _panels(runs: Sequence[Run]) -> list[Panel]:
    import arviz_stats as azs

    with quietly():
        table = azs.compare({str(run.number): run.loo for run in runs}, round_to="none")
    made = difference_figure(table, {str(run.number): f"run {run.number}" for run in runs})
    likelihood = str(runs[0].tree.attrs.get("likelihood", ""))
    title = f"arviz.compare, {len(runs)} runs{f', {likelihood}' if likelihood else ''}"
    best = next(run for run in runs if str(run.number) == table.index[0])
    return [
        Panel(title, html=_table(table, runs), wide=True, note=_note(table)),
        Panel("Difference of elpd, with its standard error", made),
        Panel(f"By event: difference to run {best.number}", _by_event(runs, best)),
    ]


def _note(table: Any) -> str:
    """What elpd is, and what ArviZ doubts of the differences."""
    said = "elpd: log density of the left-out events, summed over the events."
    doubts = sorted({str(one) for one in table.get("diag_diff", ()) if one})
    if doubts:
        said += f" ArviZ doubts the errors of these differences: {', '.join(doubts)} (N: events)."
    return said


def _warning(run: Run) -> str:
    """What to say of a run whose elpd is not to be relied on."""
    loo = run.loo
    if not loo.warning:
        return ""
    n = int(np.sum(~(np.asarray(loo.pareto_k, dtype=float) <= float(loo.good_k))))
    return f" (Pareto k above {float(loo.good_k):.2f} for {n} event{'s' if n != 1 else ''})"


def _table(table: Any, runs: Sequence[Run]) -> str:
    of = {str(run.number): run for run in runs}
    columns = [
        ("rank", "rank", 0), ("elpd", "elpd [nats]", 1), ("se", "standard error", 1),
        ("p", "effective parameters", 1), ("elpd_diff", "difference", 1), ("diff_se", "its error", 1),
        ("dse", "its error", 1), ("weight", "weight", 2),
    ]  # fmt: skip
    there = [(key, words, digits) for key, words, digits in columns if key in table]
    head = Markup("").join(Markup('<th class="n">{}</th>').format(words) for _, words, _ in there)
    rows = Markup("")
    for name, row in table.iterrows():
        cells = Markup("").join(
            Markup('<td class="n">{}</td>').format(f"{float(row[key]):.{digits}f}")
            for key, _, digits in there
        )
        one = of[str(name)]
        rows += Markup('<tr><th>{}: {}<span class="bad">{}</span></th>{}</tr>').format(
            one.number, one.title, _warning(one), cells
        )
    return str(
        Markup("<table><thead><tr><th>run</th>{}</tr></thead><tbody>{}</tbody></table>").format(head, rows)
    )


def _by_event(runs: Sequence[Run], best: Run) -> Any:
    events = best.event_ids
    made = new_figure("event", "difference of elpd [nats]", height=330)
    reference = np.asarray(best.loo.elpd_i, dtype=float).ravel()
    others = [run for run in runs if run is not best]
    for number, run in enumerate(others):
        data = {
            "x": np.arange(len(events), dtype=float),
            "y": np.asarray(run.loo.elpd_i, dtype=float).ravel() - reference,
            "title": [run.title] * len(events),
        }
        points(
            made, data, events, colour=PALETTE[number % len(PALETTE)],
            marker=_BOKEH_MARKERS[MARKERS[number % len(MARKERS)]],
            legend=f"run {run.number}",
            tips=[("run", "@title"), ("difference", "@y{0.00}")],
        )  # fmt: skip
    name_events(made, events)
    legend_above(made)
    return made
