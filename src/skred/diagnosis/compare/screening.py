"""Linearised screening: the evidence at every place along tangents, and by fronts where tangents mislead."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at
from skred.diagnosis.evidence.event_quadrature import FRONTS, ROUGH, Budget
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
_PROMISED = 0.3
"""Nats that a rough curve must have for fronts to be asked at its maximum."""
_FAR_OFF = 4.0
"""Standard deviations beyond which a reading is far off: one in sixteen thousand is by chance."""
_FAR_SHARE = 0.02
"""Share of such readings that is many: that of the robust error model's larger outlier share."""
_FAR_BEHIND = 10.0
"""Nats behind its mechanism's best at which a place is not screened under another error model: it counts for
nothing."""


def screening_budget(base: Base) -> Budget:
    """Nodes for a look at every place: readings along tangents, unless many readings are far off.

    Robust errors take what is far from a front for outliers and see no direction to go; only fronts
    themselves tell then that a strong effect brings them back.
    """
    extension = extended(base.problem, base.law, base.directions)
    predictions = extension.predict(base.rows.event, base.fit.points, base.strengths)[:, :-1]
    readings = base.rows.readings
    stated = np.hypot(readings.relative_sd * predictions, readings.absolute_sd)
    sd = np.where(readings.stated_sd > 0.0, readings.stated_sd, stated)
    far = np.abs(readings.values - predictions) > _FAR_OFF * sd
    return FRONTS if far[readings.observed].mean() > _FAR_SHARE else ROUGH


def curve(base: Base, mechanism: Mechanism, shape: Shape, budget: Budget) -> Curve:
    """Evidence along the strength of a mechanism, on a grid over its prior and about each global start.

    Many recordings tell strengths far below the prior's scale, or far beyond what a refit from the base law
    reaches; the grid alone would miss where the evidence is. With the budget ``ROUGH`` quick enough for every
    place, and wrong by nats where fronts stop near sensors.
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
    found = curve_at(base, mechanism, shape, np.unique(strengths), budget, begin=begin)
    signs = signs[[_may_be_stronger(found, sign, scale * _GRID[-1]) for sign in signs]]
    if len(signs):
        stronger = np.multiply.outer(signs, scale * np.array(_STRONGER)).ravel()
        found = found.joined(curve_at(base, mechanism, shape, stronger, budget, begin=begin))
    return _by_fronts(base, found) if found.rough else found


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


def _by_fronts(base: Base, rough: Curve) -> Curve:
    """A rough curve whose evidence for anything is what fronts say at its top, in proportion elsewhere.

    Where fronts stop, tangents can promise ten nats that are not there, at more places than are looked at
    again.
    """
    top = int(np.argmax(rough.log_evidence))
    promised = float(rough.log_evidence[top])
    if promised < _PROMISED:
        return rough
    strengths = rough.strengths[[top]]
    near = curve_at(base, rough.mechanism, rough.shape, strengths, FRONTS, rough.known)
    there = max(float(near.log_evidence[near.strengths == strengths[0]][0]), 0.0)
    heights = np.where(rough.log_evidence > 0.0, rough.log_evidence * (there / promised), rough.log_evidence)
    return replace(rough, log_evidence=heights)


def screened(
    base: Base,
    budget: Budget,
    pool: ThreadPoolExecutor,
    tell: Tell = lambda done, of: None,
    before: Sequence[Curve] = (),
) -> list[Curve]:
    """A rough curve for each candidate.

    Under another error model only places are looked at that may count: each mechanism's best ones, and
    others once these have fallen behind.

    Parameters
    ----------
    budget : Budget
        Quadrature points, of `screening_budget`.
    tell : callable
        Is told how many candidates are screened, and of how many.
    before : sequence of Curve, optional
        Screened under another error model: the candidates. Those that cannot count are returned as they are.
    """
    todo = [(one.mechanism, one.shape) for one in before or placed_mechanisms(base.setting, ties=False)]
    curves, looked = dict(enumerate(before)), set[int]()

    def look(number: int) -> Curve:
        mechanism, shape = todo[number]
        return curve(base, mechanism, shape, budget)

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
