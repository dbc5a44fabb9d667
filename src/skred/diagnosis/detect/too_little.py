"""Whether a campaign holds enough recordings for a diagnosis at all."""

from __future__ import annotations

from skred.inference.hierarchical.problem import HierarchicalProblem

LEAST_EVENTS = 6
LEAST_SENSORS = 2


def too_little(problem: HierarchicalProblem) -> str:
    """Why a campaign holds too little for a diagnosis; empty if it does not."""
    seen = problem.observed
    n_events = int(seen.any(axis=1).sum())
    if n_events < LEAST_EVENTS:
        return f"only {n_events} avalanches with a reading; at least {LEAST_EVENTS} are needed"
    n_sensors = int((seen.sum(axis=0) >= 2).sum())
    if n_sensors < LEAST_SENSORS:
        return f"only {n_sensors} sensor with readings of two avalanches or more; at least {LEAST_SENSORS}"
    return ""
