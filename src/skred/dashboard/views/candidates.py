"""The candidates of a diagnosis: how probable each is, where it would act, and on which events that hangs."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, FactorRange, HoverTool, Span
from markupsafe import Markup

from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.diagnosis.words import title_of
from skred.report.explore.figures import BLUE, legend_above, new_figure, points
from skred.report.explore.panel import NotShownError, Panel
from skred.report.explore.plots.pareto_k import name_events
from skred.report.explore.run import Run, apart, shown
from skred.report.shared import document as doc
from skred.report.shared.numbers import is_number, share
from skred.report.shared.style import GREY, PALETTE

_MOST, _MOST_PLACES = 16, 6


def candidate_panels(run: Run, given: Given, asked: Asked) -> list[Panel]:
    """Probabilities, evidence by place, and the leading answer without each event."""
    shares = doc.get(run.document, "probability") or {}
    ranked = sorted(((v, str(k)) for k, v in shares.items() if is_number(v)), reverse=True)[:_MOST]
    if not ranked:
        raise NotShownError("this diagnosis ended before candidates were compared")
    told = Markup("<p class='lead'>{}</p>").format(str(doc.get(run.document, "statement") or ""))
    panels = [
        Panel("The verdict", html=str(told), wide=True),
        Panel("Probability of each candidate", _probabilities(run, ranked)),
    ]
    if "shapes" in run.tree.children:
        panels.append(Panel("Evidence by the place where it would act", _by_place(run, ranked)))
    influence = doc.get(run.document, "influence")
    if influence and _without(influence):
        panels.append(_influence(run, influence))
    return panels


def _probabilities(run: Run, ranked: list[tuple[float, str]]) -> Any:
    names = [shown(title_of(run.document, name).partition(":")[0], 32) for _, name in ranked]
    names = apart(names)
    values = [value for value, _ in ranked]
    source = ColumnDataSource({"name": names, "value": values, "told": [share(v) for v in values]})
    made = new_figure("probability [-]", "", height=90 + 24 * len(names), x_range=(0, 1.25),
                      y_range=FactorRange(factors=names[::-1]))  # fmt: skip
    bars = made.hbar("name", right="value", height=0.6, source=source, color=BLUE, fill_alpha=0.7)
    made.text("value", "name", text="told", source=source, x_offset=5, text_baseline="middle",
              text_font_size="12px")  # fmt: skip
    made.add_tools(HoverTool(renderers=[bars], tooltips=[("candidate", "@name"), ("probability", "@told")]))
    made.ygrid.visible = False
    made.xaxis.ticker.desired_num_ticks = 3
    return made


def _by_place(run: Run, ranked: list[tuple[float, str]]) -> Any:
    """The best log Bayes factor of a candidate over stretches around each place."""
    shapes = run.group("shapes")
    made = new_figure("place along the track s [m]", "log Bayes factor [nats]", height=330)
    names = shapes["mechanism"].values.astype(str)
    starts, ends = shapes["s_from"].values.astype(float), shapes["s_to"].values.astype(float)
    factors = shapes["log_bayes_factor"].values.astype(float)
    count = 0
    for _, name in ranked:
        mine = (names == name) & np.isfinite(starts) & np.isfinite(ends)
        if not mine.any() or count == _MOST_PLACES:
            continue
        at = np.unique(np.concatenate([starts[mine], ends[mine], 0.5 * (starts[mine] + ends[mine])]))
        covers = (starts[mine][:, None] <= at) & (at <= ends[mine][:, None])
        best = np.where(covers, factors[mine][:, None], -np.inf).max(axis=0)
        known = np.isfinite(best)
        made.line(at[known], best[known], color=PALETTE[count % len(PALETTE)], line_width=2,
                  legend_label=shown(title_of(run.document, name).partition(":")[0], 32))  # fmt: skip
        count += 1
    made.add_layout(Span(location=0, dimension="width", line_color=GREY))
    legend_above(made)
    return made


def _without(influence: Any) -> dict[str, float]:
    """Log Bayes factor without each event."""
    events = doc.get(influence, "events")
    if isinstance(events, dict):
        return {str(k): float(v) for k, v in events.items() if is_number(v)}
    found = {}
    for one in doc.listed(influence, "events"):
        value = doc.get(one, "log_bayes_factor")
        if is_number(value):
            found[str(doc.get(one, "event"))] = float(value)
    return found


def _influence(run: Run, influence: Any) -> Panel:
    without = _without(influence)
    events = [shown(one, 60) for one in without]
    made = new_figure("event left out", "log Bayes factor without it [nats]", height=330)
    carried = [str(one) for one in doc.listed(influence, "carried_by")]
    data = {"x": np.arange(len(events), dtype=float), "y": list(without.values())}
    points(made, data, events, tips=[("without it", "@y{0.0} nats")])
    for name in ("log_bayes_factor", "needed"):
        value = doc.get(influence, name)
        if is_number(value):
            made.add_layout(
                Span(location=float(value), dimension="width", line_color=GREY, line_dash="dashed")
            )
    name_events(made, events)
    note = (
        "Dashed: with all events, and what an answer needs. The lower without an event, the more hangs on it."
    )
    if carried:
        note += f" Carried by {', '.join(shown(one, 30) for one in carried)}."
    return Panel("The leading answer without each event", made, note=note, wide=True)
