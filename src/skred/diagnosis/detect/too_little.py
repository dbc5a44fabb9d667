"""Whether a campaign holds enough recordings for a diagnosis at all."""

from __future__ import annotations

from skred.diagnosis.words import counted
from skred.inference.hierarchical.problem import HierarchicalProblem

LEAST_EVENTS = 6
"""Avalanches with a reading that a diagnosis needs: from fewer neither the spread of a population nor what
bootstrap campaigns look like can be told."""
LEAST_SENSORS = 2
"""Sensors that a diagnosis needs: of one, every difference is one of the base law's own strengths."""


def too_little(problem: HierarchicalProblem) -> str:
    """Why a campaign holds too little for a diagnosis; empty if it does not."""
    seen = problem.observed
    n_events = int(seen.any(axis=1).sum())
    if n_events < LEAST_EVENTS:
        have = f"only {counted(n_events, 'avalanche')} {'has' if n_events == 1 else 'have'} a reading"
        more = counted(LEAST_EVENTS - n_events, "more avalanche")
        return f"{have}, and a diagnosis needs {LEAST_EVENTS}; record {more}"
    n_sensors = int((seen.sum(axis=0) >= 2).sum())
    if n_sensors < LEAST_SENSORS:
        have = f"only {counted(n_sensors, 'sensor')} {'has' if n_sensors == 1 else 'have'} readings of two"
        return (
            f"{have} avalanches or more, and a diagnosis needs {LEAST_SENSORS}; record front speeds at a"
            " place that the avalanches pass"
        )
    return ""
