"""Brute-force nodes of each event: all points of a regular lattice where its likelihood is not nil.

The lattice lies along the axes of what was found, closer than the narrowest population of interest, and is
filled from the points of a search to all neighbours until nothing more counts. On a regular lattice the sum
converges faster than any power of its step where the integrand is smooth. Where its two halves, like the
colours of a chessboard, do not agree it is made finer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.event_sums import EventNodes
from benchmarks.reference.population_prior import covariance_of
from benchmarks.reference.search import Envelope, Recorded

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
CUT = 13.0
"""Nats below an event's highest point, with the envelope, at which the lattice ends."""
_SEEDS = 6.0
_AGREE = 0.05
"""By how much the halves of a lattice may differ."""
_FINER, _MOST_FINER = 0.6, 3
_NARROW = 0.08
"""Spread of the narrowest population while none is known."""
_MOST_NODES, _MOST_REFINED = 30000, 4000
_BITS = 15
_HALF = 1 << (_BITS - 1)
_LOG_SQRT_2PI = 0.5 * math.log(2.0 * math.pi)


class Cloud(NamedTuple):
    """Points of one event, and what they count for.

    Attributes
    ----------
    points : (k, n + 1) array
    log_likelihoods : (k,) array
        With the release's own prior density, but for its constant.
    """

    points: FloatArray
    log_likelihoods: FloatArray

    def heights(self, envelope: Envelope) -> FloatArray:
        """Log likelihoods with an envelope of populations."""
        return np.asarray(self.log_likelihoods + envelope(self.points[:, :-1]))


class Resolved(NamedTuple):
    """Nodes of all events, and the clouds that they came from.

    Attributes
    ----------
    nodes : EventNodes
    clouds : list of Cloud
    disagreement : float
        Largest difference of the halves of a lattice, of any event [nats].
    """

    nodes: EventNodes
    clouds: list[Cloud]
    disagreement: float


class _Frames(NamedTuple):
    """Lattices of all events: point = centre + axes @ (step * (number + offset)).

    Where a release is exact its axis is empty, and its numbers are 0.
    """

    centre: FloatArray
    axes: FloatArray
    step: FloatArray
    offset: FloatArray

    def points(self, events: IntArray, numbers: IntArray) -> FloatArray:
        moved = self.step[events][:, None] * (numbers + self.offset[events])
        return np.asarray(self.centre[events] + np.einsum("kij,kj->ki", self.axes[events], moved))

    def numbers(self, event: int, points: FloatArray, axes: int) -> IntArray:
        white = np.linalg.solve(
            self.axes[event][:axes, :axes], (points[:, :axes] - self.centre[event, :axes]).T
        ).T
        numbers = np.zeros(points.shape, dtype=np.int64)
        numbers[:, :axes] = np.rint(white / self.step[event] - self.offset[event, :axes])
        return numbers


class _Filled(NamedTuple):
    """Lattice points that count, in the order of the events."""

    events: IntArray
    numbers: IntArray
    heights: FloatArray
    likelihoods: FloatArray

    def of(self, event: int) -> _Filled:
        """Those of one event."""
        first, last = np.searchsorted(self.events, [event, event + 1])
        return self.taken(slice(int(first), int(last)))

    def taken(self, part: slice | IntArray) -> _Filled:
        """Some of them."""
        return _Filled(self.events[part], self.numbers[part], self.heights[part], self.likelihoods[part])

    @classmethod
    def joined(cls, parts: list[_Filled]) -> _Filled:
        """All of some parts."""
        return cls(
            np.concatenate([one.events for one in parts]),
            np.concatenate([one.numbers for one in parts]),
            np.concatenate([one.heights for one in parts]),
            np.concatenate([one.likelihoods for one in parts]),
        )


def population_envelope(draws: FloatArray, n: int, wider: float = 1.3, n_used: int = 24) -> Envelope:
    """Log mean density over some populations, each wider than it is."""
    used = draws[np.linspace(0, len(draws) - 1, n_used).astype(int)]
    covariance = wider**2 * covariance_of(used, n)
    # The tails of the population's mean, which so few draws do not reach.
    covariance += np.cov(draws[:, :n].T).reshape(n, n)
    factors = np.linalg.cholesky(covariance)
    whiten = np.linalg.inv(factors)
    constant = np.log(np.einsum("gii->gi", whiten)).sum(axis=1)

    def envelope(points: FloatArray) -> FloatArray:
        total = np.full(len(points), -np.inf)
        for mean, white, own in zip(used[:, :n], whiten, constant, strict=True):
            z = (points - mean) @ white.T
            total = np.logaddexp(total, own - 0.5 * np.sum(z**2, axis=1))
        return total

    return envelope


def narrow_precision(draws: FloatArray | None, n: int) -> FloatArray:
    """Precision of the narrowest population that nodes must resolve, (n, n)."""
    if draws is None:
        return np.asarray(np.eye(n) / _NARROW**2)
    spreads = np.exp(np.quantile(draws[:, n : 2 * n], 0.02, axis=0))
    return np.asarray(np.diag(spreads**-2.0))


def resolve(
    recorded: Recorded,
    clouds: list[Cloud],
    envelope: Envelope,
    narrow: FloatArray,
    rng: np.random.Generator,
    step: float = 0.9,
    cut: float = CUT,
) -> Resolved:
    """Nodes of all events.

    Parameters
    ----------
    clouds : list of Cloud
        Where each event's likelihood is, roughly.
    narrow : (n, n) array
        Of `narrow_precision`.
    step : float
        Of the lattice, in standard deviations of what is narrowest along each axis.
    cut : float
        Nats below an event's highest point at which it ends.
    """
    n_events = recorded.n_events
    tops = [cloud.heights(envelope) for cloud in clouds]
    frames = _frames(recorded, clouds, tops, narrow, rng, step)
    seeds = [clouds[e].points[tops[e] > tops[e].max() - _SEEDS] for e in range(n_events)]
    found = _filled(recorded, frames, seeds, envelope, list(range(n_events)), cut)
    parts = [found.of(e) for e in range(n_events)]
    for _ in range(_MOST_FINER):
        wrong = [
            e
            for e, own in enumerate(parts)
            if _halves_differ(own) > _AGREE and len(own.events) < _MOST_REFINED
        ]
        if not wrong:
            break
        for e in wrong:
            kept = parts[e].heights > parts[e].heights.max() - _SEEDS
            seeds[e] = frames.points(parts[e].events[kept], parts[e].numbers[kept])
            frames.step[e] *= _FINER
        found = _filled(recorded, frames, seeds, envelope, wrong, cut)
        for e in wrong:
            parts[e] = found.of(e)
    sums = [_summed(recorded, frames, own) for own in parts]
    first = np.concatenate([[0], np.cumsum([len(part[1]) for part in sums])]).astype(np.int64)
    points = np.ascontiguousarray(np.concatenate([part[0] for part in sums]).T)
    nodes = EventNodes(first, points, np.concatenate([part[1] for part in sums]))
    every = [Cloud(frames.points(own.events, own.numbers), own.likelihoods) for own in parts]
    return Resolved(nodes, every, max(_halves_differ(own) for own in parts))


def _axes_of(recorded: Recorded, event: int) -> int:
    return recorded.n + int(recorded.loose[event])


def _frames(
    recorded: Recorded,
    clouds: list[Cloud],
    tops: list[FloatArray],
    narrow: FloatArray,
    rng: np.random.Generator,
    step: float,
) -> _Frames:
    n, n_events = recorded.n, recorded.n_events
    centres, factors = np.zeros((n_events, n + 1)), np.zeros((n_events, n + 1, n + 1))
    for e, (cloud, heights) in enumerate(zip(clouds, tops, strict=True)):
        axes = _axes_of(recorded, e)
        weights = np.exp(heights - heights.max())
        weights /= weights.sum()
        own = cloud.points[:, :axes]
        centres[e, :axes] = weights @ own
        away = own - centres[e, :axes]
        precision = np.linalg.inv((weights * away.T) @ away + 1e-10 * np.eye(axes))
        precision[:n, :n] += narrow
        if axes > n:
            precision[n, n] += 1.0
        factors[e, :axes, :axes] = np.linalg.cholesky(np.linalg.inv(precision))
    return _Frames(centres, factors, np.full(n_events, step), rng.random((n_events, n + 1)))


def _filled(
    recorded: Recorded,
    frames: _Frames,
    seeds: list[FloatArray],
    envelope: Envelope,
    events: list[int],
    cut: float,
) -> _Filled:
    """The lattice points of some events that count: from the seeds to all neighbours."""
    n, n_events = recorded.n, recorded.n_events
    starts = [_code(e, frames.numbers(e, seeds[e], _axes_of(recorded, e))) for e in events]
    todo = np.unique(np.concatenate(starts))
    known, top = np.empty(0, dtype=np.int64), np.full(n_events, -np.inf)
    count = np.zeros(n_events, dtype=np.int64)
    layers: list[_Filled] = []
    while len(todo):
        which, numbers = _decode(todo, n + 1)
        points = frames.points(which, numbers)
        released = recorded.log_likelihood(which, points) - 0.5 * points[:, n] ** 2
        heights = released + envelope(points[:, :n])
        layers.append(_Filled(which, numbers, heights, released))
        known = np.sort(np.concatenate([known, todo]), kind="stable")
        np.maximum.at(top, which, heights)
        count += np.bincount(which, minlength=n_events)
        good = (heights > top[which] - cut) & (count[which] < _MOST_NODES)
        beside = _beside(todo[good], recorded.loose[which[good]], n + 1)
        place = np.minimum(np.searchsorted(known, beside), len(known) - 1)
        todo = beside[known[place] != beside]
    every = _Filled.joined(layers)
    order = np.argsort(every.events, kind="stable")
    order = order[every.heights[order] > top[every.events[order]] - cut - 3.0]
    return every.taken(order)


def _code(event: int, numbers: IntArray) -> IntArray:
    """An event and its numbers along each axis as one number."""
    code = np.full(len(numbers), event, dtype=np.int64)
    for axis in range(numbers.shape[1]):
        code = (code << _BITS) | np.clip(numbers[:, axis] + _HALF, 1, 2 * _HALF - 2)
    return code


def _decode(codes: IntArray, axes: int) -> tuple[IntArray, IntArray]:
    parts = [(codes >> (_BITS * (axes - 1 - axis))) & (2 * _HALF - 1) for axis in range(axes)]
    return codes >> (_BITS * axes), np.asarray(np.column_stack(parts) - _HALF)


def _beside(codes: IntArray, loose: NDArray[np.bool_], axes: int) -> IntArray:
    """Neighbours along each axis; the last is the release."""
    steps = [sign * (1 << (_BITS * axis)) for axis in range(1, axes) for sign in (-1, 1)]
    parts = [codes + step for step in steps] + [codes[loose] - 1, codes[loose] + 1]
    return np.unique(np.concatenate(parts))


def _halves_differ(own: _Filled) -> float:
    """Difference of the logarithms of an event's sums over both colours of its lattice."""
    even = own.numbers.sum(axis=1) % 2 == 0
    if not even.any() or even.all():
        return math.inf
    sums = [np.logaddexp.reduce(own.heights[half]) for half in (even, ~even)]
    return abs(float(sums[0] - sums[1]))


def _summed(recorded: Recorded, frames: _Frames, own: _Filled) -> tuple[FloatArray, FloatArray]:
    """Points in the log coefficients, summed over the release, and their log weights."""
    n, event = recorded.n, int(own.events[0])
    axes = _axes_of(recorded, event)
    diagonal = np.diag(frames.axes[event])[:axes]
    log_volume = axes * math.log(frames.step[event]) + float(np.log(diagonal).sum())
    points = frames.points(own.events, own.numbers)[:, :n]
    if axes == n:
        return points, own.likelihoods + log_volume
    # The factor is lower triangular: the release does not move the log coefficients.
    codes = _code(0, own.numbers[:, :n])
    _, index, inverse = np.unique(codes, return_index=True, return_inverse=True)
    total = np.full(len(index), -np.inf)
    np.logaddexp.at(total, inverse, own.likelihoods)
    return points[index], total + log_volume - _LOG_SQRT_2PI
