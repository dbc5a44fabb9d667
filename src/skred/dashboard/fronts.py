"""Front speeds along the track of the recorded events, from the draws in a run's tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.errors import InputError
from skred.inference.added_terms import AddedTerm, added_terms, contributions_with
from skred.physics.geometry import contributions_of, path_of
from skred.physics.kernel.fronts import front_speeds
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.terrain import Terrain
from skred.report.explore.panel import NotShownError
from skred.report.explore.run import Run

_MOST_CURVES, _MOST_DRAWS = 1200, 16
"""Curves of a run, and draws of an event."""


@dataclass(frozen=True, eq=False)
class EventSpeeds:
    """Front speeds of the recorded events.

    Attributes
    ----------
    s_m : (n_edges,) array
    speed : (n_draws, n_events, n_edges) array, m/s
    own : bool
        Whether every event has parameters of its own; else events of one release move alike.
    """

    s_m: FloatArray
    speed: FloatArray
    own: bool


def event_speeds(run: Run) -> EventSpeeds:
    """Simulate the recorded events with evenly chosen draws of a run.

    Raises
    ------
    NotShownError
        If the run has no law that is installed, or another one than it was calibrated with.
    """
    law, terms = _law(run), added_terms(run.tree)
    constant = run.group("constant_data")
    slope = constant["slope"].values.astype(float)
    edges = constant["cell_edge"].values.astype(float)
    terrain = Terrain(edges, np.sin(slope), np.cos(slope), constant["curvature"].values.astype(float), 0.0)
    own = "event_posterior" in run.tree.children
    strengths, releases, begin = _of_events(run, law) if own else _of_path(run, law)
    n_draws, n_events = releases.shape
    added = _added(run, terms, (n_draws, n_events))
    rows = np.concatenate([strengths, added], axis=2)
    speed = front_speeds(
        np.ascontiguousarray(rows.reshape(n_draws * n_events, -1)),
        releases.ravel(),
        path_of(terrain),
        contributions_with(contributions_of(law.mechanisms, terrain), [term.direction for term in terms]),
        begin.ravel(),
    )
    return EventSpeeds(edges, speed.reshape(n_draws, n_events, -1), own)


def _law(run: Run) -> Law:
    name = str(run.tree.attrs.get("law", ""))
    try:
        law = load_law(name)
    except InputError as error:
        raise NotShownError(f"its law is not installed here ({error})") from error
    if run.tree.attrs.get("equation", law.equation) != law.equation:
        raise NotShownError(f"the law {law.id} has another equation now than when it was calibrated")
    return law


def _chosen(n_chains: int, n_draws: int, n_events: int) -> tuple[IntArray, IntArray]:
    """Chain and draw of evenly chosen draws."""
    n = max(3, min(_MOST_DRAWS, _MOST_CURVES // max(1, n_events)))
    flat = np.unique(np.linspace(0, n_chains * n_draws - 1, n).astype(int))
    return flat // n_draws, flat % n_draws


def _of_events(run: Run, law: Law) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Strengths (n, n_events, n_strengths), releases and speeds there (n, n_events) of a hierarchical run."""
    data = run.group("event_posterior").transpose("chain", "draw", "event", ...)
    at = _chosen(data.sizes["chain"], data.sizes["draw"], data.sizes["event"])
    names = [mechanism.strength.name for mechanism in law.mechanisms]
    strengths = np.stack([data[name].values[at] for name in names], axis=-1)
    return strengths, data["release"].values[at], data["release_speed"].values[at]


def _of_path(run: Run, law: Law) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The same of a pooled run, whose events have the parameters of the path."""
    data, constant = run.group("posterior").transpose("chain", "draw", ...), run.group("constant_data")
    n_events = constant.sizes["event"]
    at = _chosen(data.sizes["chain"], data.sizes["draw"], n_events)
    samples = {name: data[name].values[at] for name in law.parameter_names}
    rows = law.strength_rows(samples)
    n = len(rows)
    begin = constant["release_speed"].values if "release_speed" in constant else np.zeros(n_events)
    return (
        np.repeat(rows[:, None], n_events, axis=1),
        np.tile(constant["release_s"].values.astype(float), (n, 1)),
        np.tile(np.asarray(begin, dtype=float), (n, 1)),
    )


def _added(run: Run, terms: tuple[AddedTerm, ...], shape: tuple[int, int]) -> FloatArray:
    """What each event has of the columns of the added terms, (n, n_events, n_columns), of the same draws."""
    if not any(term.direction.columns for term in terms):
        return np.empty((*shape, 0))
    data = run.group("event_posterior").transpose("chain", "draw", "event", ...)
    at = _chosen(data.sizes["chain"], data.sizes["draw"], data.sizes["event"])
    columns = [data[term.name].values[at] for term in terms for _ in term.direction.columns]
    return np.stack(columns, axis=-1)
