"""Local refinement: leading places computed anew, then split as finely as the recordings resolve.

Screening takes one place for all that is near it. Where a mechanism leads, its place is computed with more
quadrature points, and moved, shortened and lengthened. A part that holds most of the evidence is parted in
its turn, in smaller steps. A strong effect on a stretch whose ends are wrong by a tenth of its length loses
several nats, and a force of any shape would not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.evidence.coefficient import Curve
from skred.physics.mechanisms.placed import parts_of
from skred.physics.mechanisms.spec import Setting, Shape
from skred.physics.mechanisms.stretches import shares

Near = Callable[[Curve, Shape], Curve]
_WITHIN = 3.0
"""Nats behind its mechanism's best within which a place is refined: what its parts have more may differ so
much."""
_AT_MOST = 2
"""Places of a mechanism that are refined at most at a time, which bounds the time."""
_TURNS = 3
"""Turns after the leader's: others lead once a place has fallen behind."""
_MORE, _MORE_OF_OWN = 20.0, 0.6
"""Nats that the parts of a place may have more than it, or share of its own if that is more: a place that
does not come up to the best of all even so is not refined. Drag between the dam and the sensor above it has
71 nats by screening and 112 in parts, under M1 at Ryggfonn."""
_SPLIT_FROM = 1.0
"""Nats in favour of a place from which it is split: parts of a place without evidence have hardly any."""
_HOLDS_MOST = 0.5
"""Share of its place's evidence from which a part is parted itself: most of it then hangs on where it is."""
_LEVELS = 4
"""How many times places are parted: the last steps are an eighth of the first, some metres."""
_SMALLER = 0.5
"""Steps within a part, in those that led to it. At 0.38 a part of a stretch would stand for as much of the
prior as it has of the weight; half finds narrow maxima that 0.38 misses, and costs them up to 0.6 nats each
time."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place and, where it was split, its parts.

    Attributes
    ----------
    curves : tuple of Curve
        The place itself first.
    log_shares : tuple of float
        Prior weight of each within the place; they sum to 1.
    """

    curves: tuple[Curve, ...]
    log_shares: tuple[float, ...] = (0.0,)

    @property
    def log_bayes_factor(self) -> float:
        """Over the parts."""
        return float(np.logaddexp.reduce([s + c.log_bayes_factor for s, c in self._members]))

    @property
    def _members(self) -> list[tuple[float, Curve]]:
        return list(zip(self.log_shares, self.curves, strict=True))

    @property
    def holds_most(self) -> int | None:
        """Number of the part that holds most of the evidence, if one does."""
        factors = np.array([share + one.log_bayes_factor for share, one in self._members])
        first = int(np.argmax(factors))
        return first if factors[first] - self.log_bayes_factor > math.log(_HOLDS_MOST) else None

    def parted(self, number: int, parts: Sequence[Curve]) -> Place:
        """With parts that share the weight of one that is in it."""
        share = self.log_shares[number] - math.log(1 + len(parts))
        before = [share if k == number else own for k, own in enumerate(self.log_shares)]
        return Place((*self.curves, *parts), (*before, *(share for _ in parts)))


def refine(
    setting: Setting, curves: Sequence[Curve], near: Near, pool: ThreadPoolExecutor
) -> dict[str, Candidate]:
    """Candidates whose leading places are computed anew and then split; the others as they were screened.

    The leading mechanism comes first: others have to keep up with what its parts have. Once a place is looked
    at it may fall behind others that then lead, and are looked at in their turn.

    Parameters
    ----------
    setting : Setting
        In which places are split.
    curves : sequence of Curve
        Of all places, screened.
    near : callable
        Computes the curve at a shape near that of another curve.
    pool : ThreadPoolExecutor
    """
    places: dict[int, Place] = {}
    first = max(curves, key=lambda one: one.log_bayes_factor).mechanism.id
    for turn in range(1 + _TURNS):
        todo = [k for k in leading(curves, places) if k not in places]
        todo = [k for k in todo if turn > 0 or curves[k].mechanism.id == first]
        if not todo:
            break
        computed = pool.map(near, [curves[k] for k in todo], [curves[k].shape for k in todo])
        places.update({k: Place((one,)) for k, one in zip(todo, computed, strict=True)})
        height = {k: max(curves[k].log_bayes_factor, places[k].log_bayes_factor) for k in todo}
        _split(setting, [k for k in todo if height[k] > _SPLIT_FROM], places, near, pool)
    return candidates_of(curves, places)


def _split(
    setting: Setting,
    numbers: Sequence[int],
    places: dict[int, Place],
    near: Near,
    pool: ThreadPoolExecutor,
) -> None:
    """Places in parts, and in smaller steps the part that holds most of the evidence, if one does."""
    splitting = {k: 0 for k in numbers}
    for level in range(_LEVELS):
        jobs = [
            (k, places[k].curves[number], shape)
            for k, number in splitting.items()
            for shape in _parts(setting, places[k], number, _SMALLER**level)
        ]
        computed = pool.map(near, [part for _, part, _ in jobs], [shape for *_, shape in jobs])
        found: dict[int, list[Curve]] = {k: [] for k in splitting}
        for (k, *_), one in zip(jobs, computed, strict=True):
            found[k].append(one)
        places.update({k: places[k].parted(number, found[k]) for k, number in splitting.items()})
        most = {k: places[k].holds_most for k in splitting}
        splitting = {k: number for k, number in most.items() if number is not None}


def _parts(setting: Setting, place: Place, number: int, steps: float) -> list[Shape]:
    """The finer shapes that a part stands for beside its own; steps are in those of the whole place."""
    part, whole = place.curves[number], place.curves[0].shape
    mechanism, shape = part.mechanism, part.shape
    if shape.s_from_m is not None and shape.s_to_m is not None:
        assert whole.s_from_m is not None and whole.s_to_m is not None
        steps *= (whole.s_to_m - whole.s_from_m) / (shape.s_to_m - shape.s_from_m)
    known = {one.shape for one in place.curves}
    return [one for one in dict.fromkeys(parts_of(mechanism, setting, shape, steps)) if one not in known]


def leading(curves: Sequence[Curve], places: Mapping[int, Place]) -> list[int]:
    """Numbers of the places of each mechanism that lead it, as far as is known."""
    height = np.array([(places.get(k) or one).log_bayes_factor for k, one in enumerate(curves)])
    found: list[int] = []
    for name in dict.fromkeys(one.mechanism.id for one in curves):
        members = np.array([k for k, one in enumerate(curves) if one.mechanism.id == name])
        best = members[np.argsort(-height[members])][:_AT_MOST]
        least = height[members].max() - _WITHIN
        found += [int(k) for k in best if height[k] > least and _may_have(height[k]) > height.max()]
    return found


def _may_have(height: float) -> float:
    """Nats that the parts of a place may have."""
    return height + max(_MORE, _MORE_OF_OWN * height)


def candidates_of(curves: Sequence[Curve], places: Mapping[int, Place]) -> dict[str, Candidate]:
    """Curves by mechanism; parts of a place share the weight of the one that they stand in for."""
    gathered: dict[str, tuple[list[Curve], list[float]]] = {}
    for name in dict.fromkeys(one.mechanism.id for one in curves):
        own = [k for k, one in enumerate(curves) if one.mechanism.id == name]
        members, weights = gathered.setdefault(name, ([], []))
        for k, share in zip(own, shares([curves[k].shape for k in own]), strict=True):
            place = places.get(k, Place((curves[k],)))
            members += place.curves
            weights += [math.log(share) + own_share for own_share in place.log_shares]
    return {
        name: Candidate(members[0].mechanism, tuple(members), np.array(weights))
        for name, (members, weights) in gathered.items()
    }
