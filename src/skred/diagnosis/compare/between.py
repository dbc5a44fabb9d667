"""Whether avalanches differ in what a mechanism does: it is compared in each way that they may differ.

The ways share the mechanism's prior probability. They are computed at its best shape by the same tables, and
what counts is what each has more than the strength in common.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import FINE, Budget
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.tabulated.between_evidence import BetweenTarget, Way, between_evidence, search, way_of
from skred.diagnosis.tabulated.tables import wide_tables
from skred.inference.between_events import PRIOR, BetweenEvents
from skred.physics.mechanisms.spec import BoundTo, Group, Mechanism

TABLES = Budget(64, 64, 128, 1.5, 1.8), FINE
"""Quadrature points of an event in each table: to find where modes are, and then there."""


def may_differ(mechanism: Mechanism) -> bool:
    """Whether avalanches may differ in a mechanism's strength: physics, and not by a property they have."""
    added = mechanism.added
    return (
        mechanism.group is Group.PHYSICS
        and added is not None
        and added.bound_to in (BoundTo.PLACE, BoundTo.TRACK)
    )


def with_ways(
    base: Base, candidates: Mapping[str, Candidate], pool: Executor, best: float = -math.inf
) -> dict[str, Candidate]:
    """Candidates that have evidence with what they gain where avalanches differ in their strength.

    Those that may count then by finer tables. One that is far behind with a strength in common may gain more
    by this than what leads does.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    looked = [one for one in candidates.values() if may_differ(one.mechanism) and one.alone > 0.0]

    def gained(some: Sequence[Candidate], budgets: Sequence[Budget]) -> list[Candidate]:
        gains = pool.map(partial(gains_or_none, base, budgets=budgets), [one.best for one in some])
        return [replace(one, ways=ways) for one, ways in zip(some, gains, strict=True)]

    looked = gained(looked, TABLES[:1])
    least = max([best, *(one.log_bayes_factor for one in looked)]) - COUNTS
    found = [*looked, *gained([one for one in looked if one.log_bayes_factor > least], TABLES)]
    return {**candidates, **{one.mechanism.id: one for one in found}}


def gains_or_none(base: Base, curve: Curve, budgets: Sequence[Budget]) -> dict[BetweenEvents, float] | None:
    """What each way has more than the strength in common, in nats; parameters as `ways_of` has them.

    None where some way has no density that draws find.
    """
    try:
        ways = ways_of(base, curve, budgets)
    except np.linalg.LinAlgError:
        return None
    common = ways[BetweenEvents.COMMON].populations.log_evidence
    return {kind: way.populations.log_evidence - common for kind, way in ways.items()}


def ways_of(base: Base, curve: Curve, budgets: Sequence[Budget] = TABLES) -> dict[BetweenEvents, Way]:
    """Evidence of each way at a curve's shape.

    Parameters
    ----------
    budgets : sequence of Budget
        Quadrature points of an event in the tables by which modes are looked for, and in those by which
        evidence is computed around the populations that were found; one where they are the same.
    """
    near = curve.nearest(curve.moments[0]).found
    tables = wide_tables(base, curve, near, budgets[0])
    targets = {kind: BetweenTarget(base, curve, tables, kind) for kind in BetweenEvents}
    found = {kind: search(target, near) for kind, target in targets.items()}
    if len(budgets) == 1:
        return {kind: way_of(target, found[kind]) for kind, target in targets.items()}
    best = max(found, key=lambda kind: math.log(PRIOR[kind]) + found[kind].log_integral)
    around = way_of(targets[best], found[best]).populations
    tables = wide_tables(base, curve, around, budgets[1])
    return {
        kind: between_evidence(BetweenTarget(base, curve, tables, kind), one.proposal)
        for kind, one in found.items()
    }
