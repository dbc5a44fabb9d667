"""Whether avalanches differ in what a mechanism does: it is compared in each way that they may differ.

The ways share the mechanism's prior probability. They are computed at its best shape by the same tables, and
what counts is what each has more than the strength in common.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from skred.diagnosis.compare.candidate import Candidate, Ways
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import FINE, Budget
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.tabulated.between_evidence import BetweenTarget, between_evidence, searched_evidence
from skred.diagnosis.tabulated.tables import wide_tables
from skred.inference.between_events import PRIOR, BetweenEvents
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.spec import BoundTo, Group, Mechanism

SEARCH = Budget(64, 64, 128, 1.5, 1.8)
"""Quadrature points of an event in the tables by which modes are looked for."""


def may_differ(mechanism: Mechanism) -> bool:
    """Whether avalanches may differ in a mechanism's strength: physics, and not by a property they have."""
    bound_to = added_of(mechanism).bound_to
    return mechanism.group is Group.PHYSICS and bound_to in (BoundTo.PLACE, BoundTo.TRACK)


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
    found = pool.map(partial(or_none, searched, base), [one.best for one in looked])
    looked = [replace(one, ways=ways) for one, ways in zip(looked, found, strict=True)]
    least = max([best, *(one.log_bayes_factor for one in looked)]) - COUNTS
    leading = [one for one in looked if one.log_bayes_factor > least and one.ways is not None]
    found = pool.map(
        partial(or_none, finer, base), [one.best for one in leading], [one.ways for one in leading]
    )
    again = [replace(one, ways=ways) for one, ways in zip(leading, found, strict=True)]
    return {**candidates, **{one.mechanism.id: one for one in (*looked, *again)}}


def or_none(compute: Callable[..., Ways], *given: Any) -> Ways | None:
    """What is computed; None where some way has no density that draws find."""
    try:
        return compute(*given)
    except np.linalg.LinAlgError:
        return None


def searched(base: Base, curve: Curve) -> Ways:
    """Each way at a curve's shape, by tables that are fine enough to find where it is."""
    near = curve.nearest(curve.moments[0]).found
    tables = wide_tables(base, curve, near, SEARCH)
    return {kind: searched_evidence(BetweenTarget(base, curve, tables, kind), near) for kind in BetweenEvents}


def finer(base: Base, curve: Curve, ways: Ways) -> Ways:
    """The same by many more quadrature points, around the populations of the most probable way."""
    around = max(ways, key=lambda kind: math.log(PRIOR[kind]) + ways[kind].populations.log_evidence)
    tables = wide_tables(base, curve, ways[around].populations, FINE)
    return {
        kind: between_evidence(BetweenTarget(base, curve, tables, kind), way.proposal)
        for kind, way in ways.items()
    }
