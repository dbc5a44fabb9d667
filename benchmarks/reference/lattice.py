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
_CUT = 13.0
"""Nats below an event's highest point, with the envelope, at which the lattice ends."""
_SEEDS = 6.0
_AGREE = 0.1
"""By how much the halves of a lattice may differ."""
_FINER, _MOST_FINER = 0.6, 3
_MOST_NODES = 30000
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


class _Frame(NamedTuple):
    """A lattice: point = centre + axes @ (step * (number + offset))."""

    centre: FloatArray
    axes: FloatArray
    step: float
    offset: FloatArray

    def points(self, numbers: IntArray) -> FloatArray:
        return np.asarray(self.centre + (self.step * (numbers + self.offset)) @ self.axes.T)

    def numbers(self, points: FloatArray) -> IntArray:
        white = np.linalg.solve(self.axes, (points - self.centre).T).T
        return np.asarray(np.rint(white / self.step - self.offset), dtype=np.int64)


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
        return np.asarray(np.eye(n) / 0.06**2)
    spreads = np.exp(np.quantile(draws[:, n : 2 * n], 0.02, axis=0))
    return np.asarray(np.diag(spreads**-2.0))


def resolve(
    recorded: Recorded,
    clouds: list[Cloud],
    envelope: Envelope,
    narrow: FloatArray,
    rng: np.random.Generator,
    step: float = 0.9,
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
    """
    n_events = recorded.n_events
    tops = [cloud.heights(envelope) for cloud in clouds]
    frames = [_frame(recorded, e, clouds[e].points, tops[e], narrow, rng, step) for e in range(n_events)]
    seeds = [clouds[e].points[tops[e] > tops[e].max() - _SEEDS] for e in range(n_events)]
    numbers, heights, likelihoods = _filled(recorded, frames, seeds, envelope, list(range(n_events)))
    for _ in range(_MOST_FINER):
        wrong = [
            e
            for e in range(n_events)
            if _halves_differ(numbers[e], heights[e]) > _AGREE and len(numbers[e]) < _MOST_NODES / 8
        ]
        if not wrong:
            break
        for e in wrong:
            kept = heights[e] > heights[e].max() - _SEEDS
            seeds[e] = frames[e].points(numbers[e][kept])
            frames[e] = frames[e]._replace(step=_FINER * frames[e].step)
        found = _filled(recorded, frames, seeds, envelope, wrong)
        for e in wrong:
            numbers[e], heights[e], likelihoods[e] = (part[e] for part in found)
    parts = [_summed(recorded, frames[e], numbers[e], likelihoods[e]) for e in range(n_events)]
    first = np.concatenate([[0], np.cumsum([len(part[1]) for part in parts])]).astype(np.int64)
    points = np.ascontiguousarray(np.concatenate([part[0] for part in parts]).T)
    nodes = EventNodes(first, points, np.concatenate([part[1] for part in parts]))
    every = [Cloud(_full(recorded, frames[e].points(numbers[e])), likelihoods[e]) for e in range(n_events)]
    worst = max(_halves_differ(numbers[e], heights[e]) for e in range(n_events))
    return Resolved(nodes, every, worst)


def _axes_of(recorded: Recorded, event: int) -> int:
    return recorded.n + int(recorded.loose[event])


def _full(recorded: Recorded, points: FloatArray) -> FloatArray:
    """Points with the release's deviation last, 0 where there is none."""
    n = recorded.n
    return points if points.shape[1] == n + 1 else np.column_stack([points, np.zeros(len(points))])


def _frame(
    recorded: Recorded,
    event: int,
    points: FloatArray,
    heights: FloatArray,
    narrow: FloatArray,
    rng: np.random.Generator,
    step: float,
) -> _Frame:
    n, axes = recorded.n, _axes_of(recorded, event)
    weights = np.exp(heights - heights.max())
    weights /= weights.sum()
    own = points[:, :axes]
    centre = weights @ own
    away = own - centre
    covariance = (weights * away.T) @ away + 1e-10 * np.eye(axes)
    precision = np.linalg.inv(covariance)
    precision[:n, :n] += narrow
    if axes > n:
        precision[n, n] += 1.0
    factor = np.linalg.cholesky(np.linalg.inv(precision))
    return _Frame(centre, factor, step, rng.random(axes))


def _filled(
    recorded: Recorded,
    frames: list[_Frame],
    seeds: list[FloatArray],
    envelope: Envelope,
    events: list[int],
) -> tuple[dict[int, IntArray], dict[int, FloatArray], dict[int, FloatArray]]:
    """Numbers, heights and log likelihoods of the lattice points of some events that count."""
    n = recorded.n
    known = {e: np.empty(0, dtype=np.int64) for e in events}
    height = {e: np.empty(0) for e in events}
    likelihood = {e: np.empty(0) for e in events}
    todo = {e: np.unique(_code(frames[e].numbers(seeds[e][:, : _axes_of(recorded, e)]))) for e in events}
    while todo:
        points = {
            e: _full(recorded, frames[e].points(_decode(codes, _axes_of(recorded, e))))
            for e, codes in todo.items()
        }
        every = np.concatenate(list(points.values()))
        which = np.repeat(list(points), [len(one) for one in points.values()])
        found = recorded.log_likelihood(which, every)
        released = found - 0.5 * every[:, n] ** 2
        counts = released + envelope(every[:, :n])
        place = 0
        for e, codes in list(todo.items()):
            part = slice(place, place + len(codes))
            place += len(codes)
            known[e] = np.concatenate([known[e], codes])
            height[e] = np.concatenate([height[e], counts[part]])
            likelihood[e] = np.concatenate([likelihood[e], released[part]])
            good = codes[counts[part] > height[e].max() - _CUT]
            new = np.setdiff1d(_beside(good, _axes_of(recorded, e)), known[e])
            if len(new) == 0 or len(known[e]) > _MOST_NODES:
                del todo[e]
            else:
                todo[e] = new
    numbers = {}
    for e in events:
        kept = height[e] > height[e].max() - _CUT - 4.0
        numbers[e] = _decode(known[e][kept], _axes_of(recorded, e))
        height[e], likelihood[e] = height[e][kept], likelihood[e][kept]
    return numbers, height, likelihood


def _code(numbers: IntArray) -> IntArray:
    """Numbers along each axis as one number."""
    clipped = np.clip(numbers + _HALF, 1, 2 * _HALF - 2)
    code = np.zeros(len(numbers), dtype=np.int64)
    for axis in range(numbers.shape[1]):
        code = (code << _BITS) | clipped[:, axis]
    return code


def _decode(codes: IntArray, axes: int) -> IntArray:
    parts = [(codes >> (_BITS * (axes - 1 - axis))) & (2 * _HALF - 1) for axis in range(axes)]
    return np.asarray(np.column_stack(parts) - _HALF)


def _beside(codes: IntArray, axes: int) -> IntArray:
    """Neighbours along each axis."""
    steps = [sign * (1 << (_BITS * axis)) for axis in range(axes) for sign in (-1, 1)]
    return np.unique(np.concatenate([codes + step for step in steps])) if len(codes) else codes


def _halves_differ(numbers: IntArray, heights: FloatArray) -> float:
    """Difference of the logarithms of an event's sums over both colours of its lattice."""
    even = numbers.sum(axis=1) % 2 == 0
    if not even.any() or even.all():
        return math.inf
    sums = [np.logaddexp.reduce(heights[half]) for half in (even, ~even)]
    return abs(float(sums[0] - sums[1]))


def _summed(
    recorded: Recorded, frame: _Frame, numbers: IntArray, likelihoods: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points in the log coefficients, summed over the release, and their log weights."""
    n, axes = recorded.n, numbers.shape[1]
    log_volume = axes * math.log(frame.step) + float(np.log(np.diag(frame.axes)).sum())
    points = frame.points(numbers)[:, :n]
    if axes == n:
        return points, likelihoods + log_volume
    # The factor is lower triangular: the release does not move the log coefficients.
    _, index, inverse = np.unique(_code(numbers[:, :n]), return_index=True, return_inverse=True)
    total = np.full(len(index), -np.inf)
    np.logaddexp.at(total, inverse, likelihoods)
    return points[index], total + log_volume - _LOG_SQRT_2PI
