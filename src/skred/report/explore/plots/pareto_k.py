"""How much each event weighs: Pareto k."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import Range1d, Span
from numpy.typing import ArrayLike

from skred.report.explore.figures import of_events, quietly, styled
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run
from skred.report.shared.style import GREY

HOW = (
    "An event above the dashed line is so influential that leaving it out by importance sampling cannot be"
    " trusted."
)
"""How to read it."""


def pareto_panels(run: Run) -> list[Panel]:
    """Pareto k of each event by arviz-plots, the limit of importance sampling as a line."""
    note = ""
    if len(run.group("log_likelihood").data_vars) > 1:
        note = f" Of the variable {run.likelihood_name}."
    return [pareto_panel(run.loo, run.event_ids, "Pareto k by event", note)]


def pareto_panel(loo: Any, events: list[str], title: str, note: str = "") -> Panel:
    """Pareto k of each event.

    Parameters
    ----------
    loo : ELPDData
        With ``pareto_k``, (n_events,).
    events : list of str
    title, note : str
    """
    import arviz_plots as azp

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
    made.y_range = _range_with(np.asarray(loo.pareto_k, dtype=float), limit)
    name_events(made, events)
    over = int(np.sum(~(np.asarray(loo.pareto_k, dtype=float) <= limit)))
    said = f"Dashed: the limit {limit:.2f}. {over} of {len(events)} events lie above it."
    return Panel(title, made, note=said + note, wide=True)


def _range_with(k: np.ndarray, limit: float) -> Range1d:
    """A range that holds the limit as well."""
    values = [*k[np.isfinite(k)], limit]
    room = 0.06 * (max(values) - min(values)) or 0.1
    return Range1d(min(values) - room, max(values) + room)


def loo_of(pareto_k: ArrayLike, limit: float) -> Any:
    """Pareto k of a document as ArviZ holds it.

    Parameters
    ----------
    pareto_k : (n_events,) array
    limit : float
    """
    import xarray as xr
    from arviz_stats.utils import ELPDData

    k = xr.DataArray(np.asarray(pareto_k, dtype=float), dims=["event"])
    return ELPDData(
        elpd=0.0, se=0.0, p=0.0, n_samples=0, n_data_points=len(k), scale="log", warning=False,
        good_k=limit, elpd_i=k, pareto_k=k,
    )  # fmt: skip


def name_events(made: object, events: list[str]) -> None:
    """Write the events at a horizontal axis of their numbers, where there is room."""
    n = len(events)
    if n <= 45:
        axis = made.xaxis[0]  # type: ignore[attr-defined]
        axis.ticker = list(range(n))
        axis.major_label_overrides = {k: event[:14] for k, event in enumerate(events)}
        axis.major_label_orientation = np.pi / 2
        axis.major_label_text_font_size = "12px" if n <= 16 else "10px"
