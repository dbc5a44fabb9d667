"""Make the problem of a base law with mechanisms added: find where their strengths are, and tabulate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import skred.diagnosis.augment.results  # noqa: F401 - registers what it says of readings
from skred.diagnosis.augment.added_strength import AddedStrength, added_strengths
from skred.diagnosis.augment.problem import (
    CHECKED_EVENTS,
    CLAIM_LIMIT,
    AugmentedProblem,
    extension_with,
)
from skred.diagnosis.compare.between import ways_of
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.marginal import population_at
from skred.diagnosis.tabulated.coefficient_grid import finer, locate
from skred.diagnosis.tabulated.tables import BUDGETS, Tables, build_tables
from skred.diagnosis.tabulated.wide_tables import wide_tables
from skred.inference.between_events import BetweenEvents

FloatArray = NDArray[np.float64]
MOST_ADDED = 2
"""Mechanisms added at most: tables grow with the power of their number."""
_ROUGH_DRAWS = 8
"""Draws at which a first check looks at the tables' error, before anything is sampled."""
_ROUGH_RUNS = 176
"""Events times draws up to which that look has as many quadrature points as the check after sampling."""
_ENOUGH = 0.2
"""Share of the limit below which tables are good enough at that look: of few draws the worst is not seen."""


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
    if not 1 <= len(curves) <= MOST_ADDED:
        raise ValueError(f"expected one or {MOST_ADDED} mechanisms to add, found {len(curves)}")
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
    located = locate(base, extension, curves)
    if len(added) == MOST_ADDED:
        # Of two, most of the error is between the tables' strengths: twice the nodes are twice the cost only.
        return _with_tables(base, added, build_tables(base, extension, located, BUDGETS[0]))
    for budget in BUDGETS:
        problem = _with_tables(base, added, build_tables(base, extension, located, budget))
        if _rough_error(problem) < _ENOUGH * CLAIM_LIMIT:
            return problem
    # More nodes do not help where a likelihood bends with the strength, between the tables' strengths.
    located = finer(base, extension, located)
    return _with_tables(base, added, build_tables(base, extension, located, BUDGETS[-1]))


def _differing(base: Base, curve: Curve, way: BetweenEvents) -> AugmentedProblem:
    """With one mechanism in which avalanches differ: tables around where that way has populations."""
    found, added = ways_of(base, curve)[way], added_strengths([curve], [way])
    return _with_tables(base, added, wide_tables(base, curve, found.populations, BUDGETS[0], *found.strength))


def _with_tables(base: Base, added: tuple[AddedStrength, ...], tables: Tables) -> AugmentedProblem:
    old = base.problem
    return AugmentedProblem(
        old.campaign, old.terrain, old.error_model, old.place_sd_m, base=base, added=added, tables=tables
    )


def _rough_error(problem: AugmentedProblem) -> float:
    """Error of the log likelihood per event [nats], at populations and strengths as chains start from."""
    rng, law, located = np.random.default_rng(17), problem.base.law, problem.tables.located
    reach = rng.uniform(-2.0, 2.0, (_ROUGH_DRAWS, len(located.mean))) @ located.factor.T
    added = np.clip(located.mean + reach, *problem.range)
    psi = located.populations_near(added, rng)
    means, covariances = population_at(psi, len(law.mechanisms))
    factors = np.linalg.cholesky(covariances)
    chosen = np.sort(rng.permutation(problem.campaign.n_events)[:CHECKED_EVENTS])
    own, log_shares = added[:, None], np.zeros((len(added), 1))
    errors = problem.errors_at(means, factors, own, log_shares, chosen, _ROUGH_RUNS)
    return float(np.abs(errors.mean(axis=1)).max())
