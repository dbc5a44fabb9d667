"""Whether avalanches differ in what a mechanism does: it is compared in each way that they may differ.

The ways share the mechanism's prior probability. They are computed at the best shape of each kind, and what
counts is what each has more than the strength in common there. A scale of speed that is the less probable one
with a strength in common can be the more probable one without.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from skred.diagnosis.compare.candidate import Candidate, all_but_place
from skred.diagnosis.compare.recomputed import computed_again
from skred.diagnosis.compare.ways import Looked, Ways
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.event_quadrature import FINE, USUAL
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.tabulated.between_evidence import (
    BetweenTarget,
    Way,
    between_evidence,
    searched_evidence,
)
from skred.diagnosis.tabulated.coefficient_grid import from_nothing
from skred.diagnosis.tabulated.tables import build_tables
from skred.inference.between_events import PRIOR, BetweenEvents
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.spec import BoundTo, Group, Mechanism

_DIFFERING = BetweenEvents.SPREAD, BetweenEvents.SOME


def may_differ(mechanism: Mechanism) -> bool:
    """Whether avalanches may differ in a mechanism's strength: physics, and not by a property they have."""
    bound_to = added_of(mechanism).bound_to
    return mechanism.group is Group.PHYSICS and bound_to in (BoundTo.PLACE, BoundTo.TRACK)


def with_ways(
    base: Base, candidates: Mapping[str, Candidate], pool: Executor, best: float = -math.inf
) -> dict[str, Candidate]:
    """Candidates that have evidence with what they gain where avalanches differ in their strength.

    Those that may count then by finer tables, and with a strength in common by as many quadrature points. One
    that is far behind with a strength in common may gain more by this than what leads does.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    may = [one for one in candidates.values() if may_differ(one.mechanism) and one.alone > 0.0]
    if not may:
        return dict(candidates)
    kinds = [(one, *kind) for one in may for kind in one.best_of_each(all_but_place)]
    found = defaultdict[str, list[Looked]](list)
    for (one, curve, log_share), ways in zip(
        kinds, pool.map(partial(or_none, searched, base), [curve for _, curve, _ in kinds]), strict=True
    ):
        found[one.mechanism.id].append(Looked(curve, log_share, curve.log_factor_of(curve.sign), ways or {}))
    looked = {name: replace(candidates[name], looked=tuple(shapes)) for name, shapes in found.items()}
    least = max([best, *(one.log_bayes_factor for one in looked.values())]) - COUNTS
    leading = {name: one for name, one in looked.items() if one.log_bayes_factor > least}
    while jobs := [shape for one in leading.values() for shape in one.to_look_closer]:
        computed = pool.map(partial(_looked_closer, base), jobs)
        # What comes from another process is a copy.
        closer = {old: replace(new, curve=old.curve) for old, new in zip(jobs, computed, strict=True)}
        leading = {name: one.looked_closer(closer) for name, one in leading.items()}
    return {**candidates, **looked, **leading}


def _looked_closer(base: Base, shape: Looked) -> Looked:
    """A shape by many more quadrature points, with a strength in common and without."""
    curve = shape.curve
    fine, error = computed_again(base, curve)
    log_share = shape.log_share + fine.log_bayes_factor - curve.log_bayes_factor
    ways = or_none(finer, base, curve, shape.ways) or shape.ways
    if ways:
        error = math.hypot(error, _most_probable(ways).populations.error)
    return Looked(curve, log_share, fine.log_factor_of(curve.sign), ways, error)


def or_none[Found](compute: Callable[..., Found], *given: Any) -> Found | None:
    """What is computed; None where the numerics break down: a way has no density that draws find, say."""
    try:
        return compute(*given)
    except np.linalg.LinAlgError:
        return None


def searched(base: Base, curve: Curve) -> Ways:
    """Each way at a curve's shape, by tables that are fine enough to find where it is."""
    near = curve.nearest(curve.moments[0]).found
    tables = build_tables(base, base.extended(curve.direction), from_nothing(curve, near), USUAL)
    return {kind: searched_evidence(BetweenTarget(base, curve, tables, kind), near) for kind in _DIFFERING}


def finer(base: Base, curve: Curve, ways: Ways) -> Ways:
    """The same by many more quadrature points, around the populations of the most probable way."""
    if not ways:
        return {}
    likely = _most_probable(ways)
    located = from_nothing(curve, likely.populations, max(one.farthest for one in ways.values()))
    tables = build_tables(base, base.extended(curve.direction), located, FINE)
    return {
        kind: between_evidence(BetweenTarget(base, curve, tables, kind), way.proposal)
        for kind, way in ways.items()
    }


def _most_probable(ways: Ways) -> Way:
    """The way with the highest posterior probability."""
    return ways[max(ways, key=lambda kind: math.log(PRIOR[kind]) + ways[kind].log_factor)]
