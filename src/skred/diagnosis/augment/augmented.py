"""Make the problem of a base law with mechanisms added: find where their strengths are, and tabulate."""

from __future__ import annotations

from collections.abc import Sequence

import skred.diagnosis.augment.results  # noqa: F401 - registers what it says of readings
from skred.diagnosis.augment.added_strength import added_strengths
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.compare.between import searched
from skred.diagnosis.compare.ways import Ways
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import FINE, USUAL
from skred.diagnosis.tabulated.coefficient_grid import TABLES, from_nothing, locate
from skred.diagnosis.tabulated.tables import build_tables
from skred.inference.between_events import BetweenEvents


def augmented_problem(
    base: Base,
    curves: Sequence[Curve],
    way: BetweenEvents = BetweenEvents.COMMON,
    ways: Ways | None = None,
) -> AugmentedProblem:
    """Problem of a base law with the mechanisms of some curves added, one or two.

    Calibrate it as any other: ``calibrate(augmented_problem(base, curves), base.law, settings)``. Their
    strengths are parameters, by the names of the strengths.

    Parameters
    ----------
    way : BetweenEvents
        How avalanches differ in what is added, where that is one.
    ways : mapping of BetweenEvents to Way, optional
        What a comparison has of it; looked for otherwise.

    Raises
    ------
    ValueError
        If more are added than tables can be made for, or none; if their constants exclude each other; or if
        avalanches should differ in one of two.
    """
    if len(curves) not in TABLES:
        raise ValueError(f"expected one or {max(TABLES)} mechanisms to add, found {len(curves)}")
    added = added_strengths(curves, way)
    extension = base.extended(*(one.direction for one in added))
    budget = FINE
    if way is BetweenEvents.COMMON:
        located = locate(base, extension, curves)
    elif len(curves) > 1:
        raise ValueError("of two mechanisms that are added avalanches can differ in none")
    else:
        found = (ways or searched(base, curves[0]))[way]
        located = from_nothing(curves[0], found.populations, found.farthest, found.strength)
        if way is BetweenEvents.SPREAD:
            budget = USUAL  # each draw takes nearly all of these tables
    old, tables = base.problem, build_tables(base, extension, located, budget)
    return AugmentedProblem(
        old.campaign, old.terrain, old.error_model, old.place_sd_m, base=base, added=added, tables=tables
    )
