"""Local refinement: what holds much of a mechanism's evidence is computed anew and parted, again and again.

Screening takes one shape for all that are near it. A shape that holds much of its mechanism's evidence is
computed with more quadrature points, and moved, shortened and lengthened; the parts share its weight, and
such as hold much of the evidence then are parted in their turn, in smaller steps. A strong effect on a
stretch whose ends are wrong by a tenth of its length loses several nats, and a force of any shape would not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.physics.mechanisms.placed import parts_of
from skred.physics.mechanisms.spec import Setting, Shape
from skred.physics.mechanisms.stretches import shares

Near = Callable[[Curve, Shape], Curve]
_HOLDS_MUCH = 0.2
"""Share of its mechanism's evidence from which a shape is parted: four at most."""
_LEVELS = 4
"""How many times a shape is parted: the last steps are an eighth of the first, some metres."""
_SMALLER = 0.5
"""Steps within a part, in those that led to it. At 0.38 a part of a stretch would stand for as much of the
prior as it has of the weight; half finds narrow maxima that 0.38 misses, and costs them up to 0.6 nats each
time."""


class Part(NamedTuple):
    """A shape, and what it stands for.

    Attributes
    ----------
    log_weight : float
        Prior probability among its mechanism's shapes.
    level : int
        How many times it was parted: 0 is as it was screened.
    """

    curve: Curve
    log_weight: float
    level: int = 0

    @property
    def log_factor(self) -> float:
        """Log Bayes factor, its prior weight included."""
        return self.log_weight + self.curve.log_bayes_factor

    def parted(self, others: Sequence[Curve]) -> list[Part]:
        """Itself and others, which share its weight; others alone where it was screened only."""
        curves = [self.curve, *others] if self.level else others
        log_weight = self.log_weight - math.log(len(curves))
        return [Part(one, log_weight, self.level + 1) for one in curves]


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
    parts = screened_parts(curves)
    while todo := leading(parts, best):
        jobs = [(k, shape) for k in todo for shape in _finer(setting, parts, k)]
        computed = pool.map(near, [parts[k].curve for k, _ in jobs], [shape for _, shape in jobs])
        others = defaultdict[int, list[Curve]](list)
        for (k, _), one in zip(jobs, computed, strict=True):
            others[k].append(one)
        parts = [
            new for k, one in enumerate(parts) for new in (one.parted(others[k]) if k in todo else [one])
        ]
    return candidates_of(parts)


def screened_parts(curves: Sequence[Curve]) -> list[Part]:
    """What was screened, with its prior weight."""
    parts = list[Part]()
    for name in dict.fromkeys(one.mechanism.id for one in curves):
        own = [one for one in curves if one.mechanism.id == name]
        weights = shares([one.shape for one in own])
        parts += [Part(one, math.log(share)) for one, share in zip(own, weights, strict=True)]
    return parts


def leading(parts: Sequence[Part], best: float = -math.inf) -> list[int]:
    """Numbers of those to part: where their mechanism has evidence and may come up to the best one.

    By being parted for the first time a mechanism may gain as many nats as it has: 0.6 of that was seen, of
    drag between the dam and the sensor above it at Ryggfonn. What it may gain falls with the square of the
    steps.
    """
    height = {
        name: float(np.logaddexp.reduce([one.log_factor for one in own])) for name, own in _by_id(parts)
    }
    least = max(max(best, *height.values()) - COUNTS, 0.0)
    return [
        k
        for k, one in enumerate(parts)
        if one.level < _LEVELS
        and (1.0 + _SMALLER ** (2 * one.level)) * (own := height[one.curve.mechanism.id]) > least
        and one.log_factor > own + math.log(_HOLDS_MUCH)
    ]


def candidates_of(parts: Sequence[Part]) -> dict[str, Candidate]:
    """Parts by mechanism."""
    return {
        name: Candidate(
            own[0].curve.mechanism,
            tuple(one.curve for one in own),
            np.array([one.log_weight for one in own]),
        )
        for name, own in _by_id(parts)
    }


def _by_id(parts: Sequence[Part]) -> Iterable[tuple[str, list[Part]]]:
    """The parts of each mechanism."""
    found = defaultdict[str, list[Part]](list)
    for one in parts:
        found[one.curve.mechanism.id].append(one)
    return found.items()


def _finer(setting: Setting, parts: Sequence[Part], number: int) -> list[Shape]:
    """Shapes to compute beside one, or with it where it was screened only."""
    part = parts[number]
    mechanism, shape = part.curve.mechanism, part.curve.shape
    known = {one.curve.shape for one in parts if one.curve.mechanism.id == mechanism.id}
    finer = dict.fromkeys(parts_of(mechanism, setting, shape, _SMALLER**part.level))
    own = [] if part.level else [shape]
    return own + [one for one in finer if one not in known]
