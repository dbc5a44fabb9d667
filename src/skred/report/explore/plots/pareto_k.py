"""How much each event weighs: Pareto k."""

from __future__ import annotations

import numpy as np
from bokeh.models import DataRange1d, Span

from skred.report.explore.figures import of_events, quietly, styled
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run
from skred.report.shared.style import GREY


def pareto_panels(run: Run) -> list[Panel]:
    """Pareto k of each event by arviz-plots, the limit of importance sampling as a line."""
    import arviz_plots as azp

    loo, events = run.loo, run.event_ids
    with quietly():
        collection = azp.plot_khat(loo, backend="bokeh")
    made = collection.viz["plot"].item()
    marks = collection.viz["khat"]["pareto_k"].item()
    marks.glyph.size = 8
    made.xaxis.axis_label, made.yaxis.axis_label = "event", "Pareto k [-]"
    styled(made, height=330, title="")
    of_events(marks, events, made, tips=[("Pareto k", "@y{0.00}")])
    limit = float(loo.good_k)
    made.add_layout(Span(location=limit, dimension="width", line_color=GREY, line_dash="dashed"))
    made.y_range = DataRange1d()
    name_events(made, events)
    over = int(np.sum(~(np.asarray(loo.pareto_k, dtype=float) <= limit)))
    note = f"Dashed: the limit {limit:.2f}. {over} of {len(events)} events lie above it."
    if len(run.group("log_likelihood").data_vars) > 1:
        note += f" Of the variable {run.likelihood_name}."
    return [Panel("Pareto k by event", made, note=note, wide=True)]


def name_events(made: object, events: list[str]) -> None:
    """Write the events at a horizontal axis of their numbers, where there is room."""
    n = len(events)
    if n <= 45:
        axis = made.xaxis[0]  # type: ignore[attr-defined]
        axis.ticker = list(range(n))
        axis.major_label_overrides = {k: event[:14] for k, event in enumerate(events)}
        axis.major_label_orientation = np.pi / 2
        axis.major_label_text_font_size = "12px" if n <= 16 else "10px"
