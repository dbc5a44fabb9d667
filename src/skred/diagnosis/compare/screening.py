"""Screening: the evidence of every candidate at every place, well enough to say where to look closer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at
from skred.diagnosis.evidence.event_quadrature import SCREENING
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.global_start import Start, global_starts
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import Mechanism, Shape

Tell = Callable[[int, int], None]
_GRID = (0.2, 0.6, 1.2)
"""Strengths at first, in scales of the prior: 45 % of a half-normal prior is below the second."""
_STRONGER = (2.2, 3.5)
"""Strengths beyond, where one from the last of these on is not hopeless: five in ten thousand are larger."""
_HOPELESS = 12.0
"""Nats behind the best at which stronger is not tried: it would count for one in a hundred thousand."""
_ABOUT = (-2.0, 0.0, 2.0)
"""Strengths about a global start, in its standard deviations."""
_FAR_BEHIND = 10.0
"""Nats behind its mechanism's best at which a place is not screened under another error model: it counts for
nothing."""


def curve(base: Base, mechanism: Mechanism, shape: Shape) -> Curve:
    """Evidence along the strength of a mechanism, on a grid over its prior and about each global start.

    Many recordings tell strengths far below the prior's scale, or far beyond what a refit from the base law
    reaches; the grid alone would miss where the evidence is.
    """
    added = mechanism.added
    assert added is not None
    scale = added.scale_of(shape)
    starts = _starts(base, mechanism, shape)
    begin = {0.0: base.fit} | {one.strength: one.fit for one in starts if one.strength != 0.0}
    signs = np.array([-1.0, 1.0] if added.either_sign else [1.0])
    strengths = np.multiply.outer(signs, scale * np.array(_GRID)).ravel()
    about = np.array([one.strength + one.sd * by for one in starts for by in _ABOUT])
    strengths = np.append(strengths, about if added.either_sign else about[about > 0.0])
    found = curve_at(base, mechanism, shape, np.unique(strengths), SCREENING, begin=begin)
    signs = signs[[_may_be_stronger(found, sign, scale * _GRID[-1]) for sign in signs]]
    if len(signs):
        stronger = np.multiply.outer(signs, scale * np.array(_STRONGER)).ravel()
        found = found.joined(curve_at(base, mechanism, shape, stronger, SCREENING, begin=begin))
    return found


def _starts(base: Base, mechanism: Mechanism, shape: Shape) -> list[Start]:
    """Global starts that are not hopeless."""
    added = mechanism.added
    assert added is not None
    direction = direction_of(mechanism, base.setting, shape)
    extension = extended(base.problem, base.law, (*base.directions, direction))
    begin = base.population, base.fit.points
    found = global_starts(
        extension, base.rows, base.strengths, begin, added.scale_of(shape), added.either_sign
    )
    return [one for one in found if one.height > found[0].height - _HOPELESS]


def _may_be_stronger(found: Curve, sign: float, least: float) -> bool:
    """Whether a strength of some size or more, of a sign, is not hopeless."""
    strong = sign * found.strengths > 0.999 * least
    return bool(found.log_evidence[strong].max() > found.log_evidence.max() - _HOPELESS)


def screened(
    base: Base,
    pool: ThreadPoolExecutor,
    tell: Tell = lambda done, of: None,
    before: Sequence[Curve] = (),
) -> list[Curve]:
    """A curve for each candidate.

    Under another error model only places are looked at that may count: each mechanism's best ones, and
    others once these have fallen behind.

    Parameters
    ----------
    tell : callable
        Is told how many candidates are screened, and of how many.
    before : sequence of Curve, optional
        Screened under another error model: the candidates. Those that cannot count are returned as they are.
    """
    todo = [(one.mechanism, one.shape) for one in before or placed_mechanisms(base.setting)]
    curves, looked = dict(enumerate(before)), set[int]()

    def look(number: int) -> Curve:
        mechanism, shape = todo[number]
        return curve(base, mechanism, shape)

    while jobs := sorted(set(_that_count(curves) if curves else range(len(todo))) - looked):
        looked |= set(jobs)
        for done, (number, one) in enumerate(zip(jobs, pool.map(look, jobs), strict=True), start=1):
            curves[number] = one
            tell(len(todo) - len(jobs) + done, len(todo))
    return [curves[number] for number in range(len(todo))]


def _that_count(curves: Mapping[int, Curve]) -> list[int]:
    """Numbers of the curves that are not far behind their mechanism's best."""
    best: dict[str, float] = {}
    for one in curves.values():
        best[one.mechanism.id] = max(one.log_bayes_factor, best.get(one.mechanism.id, -math.inf))
    return [
        number
        for number, one in curves.items()
        if one.log_bayes_factor > best[one.mechanism.id] - _FAR_BEHIND
    ]
