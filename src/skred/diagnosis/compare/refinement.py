"""Local refinement: what holds much of a mechanism's evidence is computed anew and parted, again and again.

Screening looks at a few places. A shape that holds more of its mechanism's evidence than the tolerance is
computed with more quadrature points, and moved, shortened and lengthened; such of these as hold so much then
are parted in their turn, in smaller steps. Between all that were looked at evidence is interpolated. A strong
effect on a stretch whose ends are wrong by a tenth of its length loses several nats, and a force of any shape
would not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.candidate import Candidate, all_but_place
from skred.diagnosis.compare.over_places import Area, OverPlaces, over_places
from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.evidence.tolerance import COUNTS, MOST_ROUNDS, STANDARD_ERROR
from skred.physics.mechanisms.placed import parts_of
from skred.physics.mechanisms.spec import Mechanism, Setting, Shape
from skred.physics.mechanisms.stretches import is_opposed, shares

Near = Callable[[Curve, Shape], Curve]
_SMALLER = 0.5
"""Steps within a part, in those that led to it."""


class Part(NamedTuple):
    """A shape that was looked at.

    Attributes
    ----------
    level : int
        How many times it was parted: 0 is as it was screened.
    """

    curve: Curve
    level: int = 0


@dataclass(frozen=True, eq=False)
class Kind:
    """Shapes of a mechanism that differ in where a stretch is alone; or a single shape.

    Attributes
    ----------
    log_share : float
        Log of the kind's prior probability among its mechanism's shapes.
    parts : tuple of Part
    area : Area, optional
        Where the stretch may be; None for a single shape.
    """

    log_share: float
    parts: tuple[Part, ...]
    area: Area | None = None

    @property
    def mechanism(self) -> Mechanism:
        """Whose shapes they are."""
        return self.parts[0].curve.mechanism

    @cached_property
    def _over(self) -> OverPlaces:
        heights = np.array([one.curve.log_bayes_factor for one in self.parts])
        if self.area is None:
            return OverPlaces(heights, np.zeros(1))
        return over_places(self.area, [one.curve.shape for one in self.parts], heights)

    @property
    def log_factors(self) -> FloatArray:
        """Log Bayes factor of each part, with the prior probability of what it stands for, (n_parts,)."""
        return self.log_share + self._over.log_means

    @property
    def log_weights(self) -> FloatArray:
        """What each part's evidence counts for, (n_parts,)."""
        return self.log_share + self._over.log_weights

    def finer(self, setting: Setting, number: int) -> list[Shape]:
        """Shapes to compute beside a part."""
        part, known = self.parts[number], {_known_by(one.curve.shape) for one in self.parts}
        around = parts_of(self.mechanism, setting, part.curve.shape, _SMALLER**part.level)
        return [one for one in around if _known_by(one) not in known]

    def parted(self, others: Mapping[int, Sequence[Curve]]) -> Kind:
        """With others beside some parts."""
        parts = list[Part]()
        for number, one in enumerate(self.parts):
            if number not in others:
                parts.append(one)
                continue
            parts += [Part(curve, one.level + 1) for curve in (one.curve, *others[number])]
        return replace(self, parts=tuple(parts))


def refine(
    setting: Setting,
    curves: Sequence[Curve],
    near: Near,
    pool: ThreadPoolExecutor,
    best: float = -math.inf,
) -> dict[str, Candidate]:
    """Candidates whose leading shapes are computed anew and parted; the others as they were screened.

    Parameters
    ----------
    setting : Setting
        In which shapes are parted.
    curves : sequence of Curve
        Of all shapes, screened.
    near : callable
        Computes the curve at a shape near that of another curve.
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    kinds = kinds_of(setting, curves)
    while todo := leading(kinds, best):
        finer = [(k, number, shape) for k, number in todo for shape in kinds[k].finer(setting, number)]
        jobs = list({(k, _known_by(shape)): (k, number, shape) for k, number, shape in finer}.values())
        known = [kinds[k].parts[number].curve for k, number, _ in jobs]
        computed = pool.map(near, known, [shape for _, _, shape in jobs])
        others = {k: {n: list[Curve]() for j, n in todo if j == k} for k, _ in todo}
        for (k, number, _), one in zip(jobs, computed, strict=True):
            others[k][number].append(one)
        kinds = [one.parted(others[k]) if k in others else one for k, one in enumerate(kinds)]
    return candidates_of(kinds)


def kinds_of(setting: Setting, curves: Sequence[Curve]) -> list[Kind]:
    """What was screened."""
    found = list[Kind]()
    for own in _by_id(curves):
        log_shares = np.log(shares([one.shape for one in own]))
        together = defaultdict[Hashable, list[int]](list)
        for k, one in enumerate(own):
            together[_all_but_place(one) if own[0].added.moves else k].append(k)
        for ks in together.values():
            area = Area.around([own[k].shape for k in ks], setting) if own[0].added.moves else None
            share = float(np.logaddexp.reduce(log_shares[ks]))
            found.append(Kind(share, tuple(Part(own[k]) for k in ks), area))
    return found


def leading(kinds: Sequence[Kind], best: float = -math.inf) -> list[tuple[int, int]]:
    """Which to part, by kind and part: where their mechanism has evidence and may come up to the best one.

    By being parted for the first time a mechanism may gain as many nats as it has: 0.6 of that was seen, of
    drag between the dam and the sensor above it at Ryggfonn. What it may gain falls with the square of the
    steps.
    """
    height = {
        own[0].mechanism.id: float(np.logaddexp.reduce(np.concatenate([one.log_factors for one in own])))
        for own in _by_id(kinds)
    }
    least = max(max(best, *height.values()) - COUNTS, 0.0)
    return [
        (k, number)
        for k, kind in enumerate(kinds)
        for number, (one, factor) in enumerate(zip(kind.parts, kind.log_factors, strict=True))
        if one.level < MOST_ROUNDS
        and (1.0 + _SMALLER ** (2 * one.level)) * (own := height[kind.mechanism.id]) > least
        and factor > own + math.log(STANDARD_ERROR)
    ]


def candidates_of(kinds: Sequence[Kind]) -> dict[str, Candidate]:
    """Candidates of all their kinds."""
    found = {}
    for own in _by_id(kinds):
        curves = tuple(part.curve for one in own for part in one.parts)
        log_weights, log_factors = (
            np.concatenate(each)
            for each in zip(*((one.log_weights, one.log_factors) for one in own), strict=True)
        )
        by_weight = log_weights + np.array([one.log_bayes_factor for one in curves])
        between = log_factors - by_weight
        found[own[0].mechanism.id] = Candidate(own[0].mechanism, curves, log_weights, log_between=between)
    return found


def _by_id[T: (Curve, Kind)](every: Sequence[T]) -> list[list[T]]:
    """Those of each mechanism."""
    found = defaultdict[str, list[T]](list)
    for one in every:
        found[one.mechanism.id].append(one)
    return list(found.values())


def _known_by(shape: Shape) -> Shape:
    """A shape with its ends to the millimetre: they are computed in more than one way."""
    first, last = (None if end is None else round(end, 3) for end in (shape.s_from_m, shape.s_to_m))
    return replace(shape, s_from_m=first, s_to_m=last)


def _all_but_place(curve: Curve) -> Hashable:
    """What shapes share that differ in their place alone: an opposed one's speeds are those of its place."""
    return all_but_place(curve), None if is_opposed(curve.shape) else curve.shape.constants
