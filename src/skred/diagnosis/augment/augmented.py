"""Make the problem of a base law with mechanisms added: find where their strengths are, and tabulate."""

from __future__ import annotations

from collections.abc import Sequence

import skred.diagnosis.augment.results  # noqa: F401 - registers what it says of readings
from skred.diagnosis.augment.added_strength import AddedStrength, added_strengths
from skred.diagnosis.augment.problem import (
    AugmentedProblem,
    extension_with,
)
from skred.diagnosis.compare.between import ways_of
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import FINE
from skred.diagnosis.tabulated.coefficient_grid import TABLES, from_nothing, locate
from skred.diagnosis.tabulated.tables import Tables, build_tables
from skred.inference.between_events import BetweenEvents


def augmented_problem(
    base: Base, curves: Sequence[Curve], way: BetweenEvents = BetweenEvents.COMMON
) -> AugmentedProblem:
    """Problem of a base law with the mechanisms of some curves added, one or two.

    Calibrate it as any other: ``calibrate(augmented_problem(base, curves), base.law, settings)``. Their
    strengths are parameters, by the names of the strengths.

    Parameters
    ----------
    way : BetweenEvents
        How avalanches differ in what is added, where that is one.

    Raises
    ------
    ValueError
        If more are added than tables can be made for, or none; if their constants exclude each other; or if
        avalanches should differ in one of two.
    """
    if len(curves) not in TABLES:
        raise ValueError(f"expected one or {max(TABLES)} mechanisms to add, found {len(curves)}")
    if way is not BetweenEvents.COMMON:
        if len(curves) > 1:
            raise ValueError("of two mechanisms that are added avalanches can differ in none")
        return _differing(base, curves[0], way)
    added = added_strengths(curves)
    speeds = {
        d.weakening_speed
        for d in (*base.directions, *(one.direction for one in added))
        if d.weakening_speed is not None
    }
    if len(speeds) > 1:
        raise ValueError(f"mechanisms with different U_c cannot be added together: {sorted(speeds)} m/s")
    extension = extension_with(base, added)
    return _with_tables(base, added, build_tables(base, extension, locate(base, extension, curves), FINE))


def _differing(base: Base, curve: Curve, way: BetweenEvents) -> AugmentedProblem:
    """With one mechanism in which avalanches differ: tables around where that way has populations."""
    found, added = ways_of(base, curve)[way], added_strengths([curve], [way])
    # Half the steps of a comparison's: what is left of errors there is between the strengths.
    located = from_nothing(curve, found.populations, *found.strength).finer
    return _with_tables(base, added, build_tables(base, extension_with(base, added), located, FINE))


def _with_tables(base: Base, added: tuple[AddedStrength, ...], tables: Tables) -> AugmentedProblem:
    old = base.problem
    return AugmentedProblem(
        old.campaign, old.terrain, old.error_model, old.place_sd_m, base=base, added=added, tables=tables
    )
