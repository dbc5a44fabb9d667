"""Bisection of the range of an event's coefficients until its likelihood is resolved; see `surface`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.inference.error_model import Errors, EventReadings
from skred.inference.hierarchical.releases import Releases
from skred.inference.reading_density import assess, log_likelihoods
from skred.physics.kernel.fronts import simulate
from skred.physics.kernel.inputs import Contributions, Path

_GAUSS = 0.5 / math.sqrt(3.0)
"""Distance of the two Gauss-Legendre nodes from the middle of a box, in its widths."""
RELEASE_REACH = 4.0
"""How many standard deviations from its mean a release is looked for."""
RELEASE_NARROW = 8.0
"""A narrow width on the axis of the release, over one on an axis of the strengths: as a standard deviation
of the release, the unit of its axis, is to a usual spread of a strength."""


@dataclass(frozen=True)
class Resolution:
    """How finely surfaces are resolved.

    Attributes
    ----------
    change : float
        Change of the readings across a box, in standard deviations, below which it is not halved.
    depth : float
        Log likelihoods (times the envelope) further than this below an event's best are left out.
    share : float
        Share of an event's integral below which a narrow box is not halved any more.
    narrow : float
        Width in logarithms of strengths at which a box counts as narrow: its bound is then no longer
        believed, because a front that just passes a counter-slope makes a jump, across which the bound
        promises all.
    release : float
        Largest width of a box on the axis of the release, in its standard deviations: with two nodes each
        boxes of 4/3 integrate its prior to 0.002 %, and times a likelihood as informative as the prior to
        0.2 %. One that is three times as informative changes too little to be halved: 3 % at worst, which
        the boxes of 1 of the finer resolution find out.
    release_change : float
        How many times the change is allowed where the release is uncertain: one axis more smooths, and makes
        each halving dearer.
    """

    change: float = 1.75
    depth: float = 16.0
    share: float = 1e-3
    narrow: float = 2e-3
    release: float = 4.0 / 3.0
    release_change: float = 1.4

    def finer(self) -> Resolution:
        """Half the spacing, and deeper: to check against."""
        return replace(
            self,
            change=0.5 * self.change,
            depth=self.depth + 8.0,
            share=0.25 * self.share,
            narrow=0.5 * self.narrow,
            release=0.75 * self.release,
        )


COARSE = Resolution(change=6.0, depth=14.0, share=1e-2, narrow=4e-2)
"""Fine enough to find the approximate population."""


class Envelope(NamedTuple):
    """A normal density that is wider than any population worth considering, but for its constant.

    Attributes
    ----------
    mean : (n_strengths,) array
        Of the logarithms of the strengths.
    whiten : (n_strengths, n_strengths) array
        Inverse of the Cholesky factor of its covariance.
    """

    mean: FloatArray
    whiten: FloatArray


class Fronts(NamedTuple):
    """Everything that the likelihood of an event's readings depends on, for given coefficients.

    Attributes
    ----------
    path : Path
    law : Contributions
    sensors : (n_sensors + 1, 3) array
        Spans read up to the stop, and the runout last.
    readings : EventReadings
    errors : Errors
    releases : Releases
    """

    path: Path
    law: Contributions
    sensors: FloatArray
    readings: EventReadings
    errors: Errors
    releases: Releases


class _Boxes(NamedTuple):
    """Boxes of some events: which event, lower corner, widths, readings at the corners."""

    event: IntArray
    low: FloatArray
    width: FloatArray
    predictions: FloatArray

    def take(self, rows: BoolArray) -> _Boxes:
        """Some of them."""
        return _Boxes(self.event[rows], self.low[rows], self.width[rows], self.predictions[rows])


class Bisection:
    """Bisection for some events; `nodes` is what it is for."""

    def __init__(
        self, fronts: Fronts, resolution: Resolution, cell: FloatArray, envelope: Envelope | None
    ) -> None:
        self.fronts, self.resolution, self.cell, self.envelope = fronts, resolution, cell, envelope
        self.n_strengths = len(fronts.law.columns)
        self.n_runs = 0

    def predict(self, events: IntArray, points: FloatArray) -> FloatArray:
        """Readings of a front for each point, (n, n_sensors + 1)."""
        strengths = np.exp(points[:, : self.n_strengths])
        self.n_runs += len(points)
        fronts = self.fronts
        deviation = points[:, -1] if points.shape[1] > self.n_strengths else np.zeros(len(points))
        places, speeds = (one(events, deviation) for one in (fronts.releases.places, fronts.releases.speeds))
        result: FloatArray = simulate(strengths, places, fronts.path, fronts.law, fronts.sensors, speeds)
        return result

    def log_envelope(self, points: FloatArray) -> FloatArray:
        """Logarithm of the envelope at points (..., n_axes); that of a release is its own prior."""
        release = points[..., self.n_strengths :]
        return self._log_strengths(points) - 0.5 * np.sum(release * release, axis=-1)

    def _log_strengths(self, points: FloatArray) -> FloatArray:
        """Logarithm of the envelope of the strengths at points (..., n_axes)."""
        if self.envelope is None:
            return np.zeros(points.shape[:-1])
        z = (points[..., : self.n_strengths] - self.envelope.mean) @ self.envelope.whiten.T
        result: FloatArray = -0.5 * np.sum(z * z, axis=-1)
        return result

    def envelope_of(self, boxes: _Boxes) -> FloatArray:
        """Logarithm of the envelope, (n_boxes, 1 + n_corners): an upper bound, and at the corners."""
        corners = boxes.low[:, None, :] + _sides(boxes.low.shape[1]) * boxes.width[:, None, :]
        result = np.zeros((len(corners), 1 + corners.shape[1]))
        result[:, 1:] = self.log_envelope(corners)
        middle, half = boxes.low + 0.5 * boxes.width, 0.5 * boxes.width
        if self.envelope is not None:
            distance = np.sqrt(-2.0 * self._log_strengths(middle))
            reach = np.linalg.norm(half[:, : self.n_strengths] @ np.abs(self.envelope.whiten.T), axis=1)
            result[:, 0] = -0.5 * np.maximum(distance - reach, 0.0) ** 2
        nearest = np.maximum(np.abs(middle) - half, 0.0)[:, self.n_strengths :]
        result[:, 0] -= 0.5 * np.sum(nearest**2, axis=1)
        return result

    def boxes(self, events: IntArray, edges: Sequence[FloatArray]) -> _Boxes:
        """All boxes of a grid for each event.

        Edges on the axes of the strengths are staggered, see `stagger`; those on the axis of the
        release, if there is one, are shares of the range it is looked for in.
        """
        n_axes = len(edges)
        corners = _grid([e[:-1] for e in edges])
        event = np.repeat(events, len(corners))
        low = np.tile(corners, (len(events), 1))
        width = np.tile(_grid([np.diff(e) for e in edges]), (len(events), 1))
        step = width[0, : self.n_strengths]
        low = self._placed(event, low, step)
        if n_axes > self.n_strengths:
            first, last = (ends[event] for ends in self.release_range())
            width[:, -1] *= last - first
        # Each vertex once, though it is a corner of many boxes.
        vertices = _grid(list(edges))
        at = np.repeat(events, len(vertices))
        rows = self.predict(at, self._placed(at, np.tile(vertices, (len(events), 1)), step))
        rows = rows.reshape(len(events), *map(len, edges), -1)
        sizes = [len(e) - 1 for e in edges]
        predictions = np.empty((len(event), 2**n_axes, rows.shape[-1]))
        for number, side in enumerate(_sides(n_axes)):
            window = tuple(slice(k, k + size) for k, size in zip(side, sizes, strict=True))
            predictions[:, number] = rows[(slice(None), *window)].reshape(len(event), -1)
        return _Boxes(event, low, width, predictions)

    def _placed(self, event: IntArray, points: FloatArray, step: FloatArray) -> FloatArray:
        """Points of the grid, at the place of each one's event."""
        placed = points.copy()
        placed[:, : self.n_strengths] += stagger(event, step)
        if points.shape[1] > self.n_strengths:
            first, last = (ends[event] for ends in self.release_range())
            placed[:, -1] = first + (last - first) * points[:, -1]
        return placed

    def split(self, boxes: _Boxes, axis: IntArray) -> _Boxes:
        """Halve each box along its axis; only the corners in between are new."""
        rows = np.arange(len(axis))
        half = boxes.width.copy()
        half[rows, axis] *= 0.5
        middle = boxes.low.copy()
        middle[rows, axis] += half[rows, axis]
        flat = half.copy()
        flat[rows, axis] = 0.0
        n_axes = boxes.low.shape[1]
        lower, upper = boxes.predictions.copy(), boxes.predictions
        for number in range(n_axes):
            chosen = np.flatnonzero(axis == number)
            if len(chosen) == 0:
                continue
            below = np.flatnonzero(_sides(n_axes)[:, number] == 0)
            sides = _sides(n_axes)[below]
            points = middle[chosen, None, :] + sides * flat[chosen, None, :]
            new = self.predict(np.repeat(boxes.event[chosen], len(below)), points.reshape(-1, n_axes))
            new = new.reshape(len(chosen), len(below), -1)
            lower[chosen[:, None], below + (1 << number)] = new
            upper[chosen[:, None], below] = new
        return _Boxes(
            np.concatenate([boxes.event, boxes.event]),
            np.concatenate([boxes.low, middle]),
            np.concatenate([half, half]),
            np.concatenate([lower, upper]),
        )

    def leaves(self, boxes: _Boxes) -> tuple[_Boxes, FloatArray, FloatArray]:
        """Boxes small enough, their bounds, and the best log likelihood of each event."""
        resolution = self.resolution
        best = np.full(len(self.fronts.releases.mean), -np.inf)
        settled = np.full(len(best), -np.inf)
        found, bounds = [], []
        while len(boxes.event):
            n_axes, envelope, fronts = boxes.low.shape[1], self.envelope_of(boxes), self.fronts
            change, bound, top, mean = assess(
                boxes.event, boxes.predictions, fronts.readings, fronts.errors, envelope
            )
            np.maximum.at(best, boxes.event, top)
            narrow = (boxes.width <= self.narrowest(n_axes)).any(axis=1)
            bound = np.where(narrow, top, bound)
            log_volume = np.log(boxes.width).sum(axis=1)
            log_mass = settled.copy()
            np.logaddexp.at(log_mass, boxes.event, mean + log_volume)
            log_share = bound + log_volume - log_mass[boxes.event]
            depth = best[boxes.event] - bound
            kept = depth < resolution.depth
            boxes, bound, change, depth = boxes.take(kept), bound[kept], change[kept], depth[kept]
            # Coarser far below the maximum, where a larger relative error does not matter.
            allowed = resolution.change * (1.0 + np.maximum(depth, 0.0) / 8.0)
            if n_axes > self.n_strengths:
                allowed *= resolution.release_change
            excess = np.maximum(change / allowed[:, None], boxes.width / self.widest(n_axes))
            done = (excess.max(axis=1, initial=0.0) <= 1.0) | (
                narrow & (log_share < math.log(resolution.share))
            )[kept]
            np.logaddexp.at(settled, boxes.event[done], (mean + log_volume)[kept][done])
            found.append(boxes.take(done))
            bounds.append(bound[done])
            boxes = self.split(boxes.take(~done), excess[~done].argmax(axis=1))
        gathered = _Boxes(*(np.concatenate([part[k] for part in found]) for k in range(4)))
        return gathered, np.concatenate(bounds), best

    def widest(self, n_axes: int) -> FloatArray:
        """Largest width of a box on each axis."""
        return self.cell if n_axes == self.n_strengths else np.append(self.cell, self.resolution.release)

    def narrowest(self, n_axes: int) -> FloatArray:
        """Width on each axis at which a box counts as narrow."""
        narrow = np.full(n_axes, self.resolution.narrow)
        narrow[self.n_strengths :] *= RELEASE_NARROW
        return narrow

    def nodes(self, events: IntArray, edges: Sequence[FloatArray]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Quadrature nodes of some events, from a grid of boxes with these edges on each axis.

        Returns
        -------
        event : (n,) integer array
        points : (n, n_strengths + 1) array
            The release's deviation last, 0 where the release is certain.
        log_weights : (n,) array
            Log likelihood plus log of the volume that a node stands for.
        """
        leaves, bound, best = self.leaves(self.boxes(events, edges))
        leaves = leaves.take(best[leaves.event] - bound < self.resolution.depth)
        n_axes = leaves.low.shape[1]
        offsets = (2 * _sides(n_axes) - 1) * _GAUSS
        middle = leaves.low + 0.5 * leaves.width
        points = (middle[:, None, :] + offsets * leaves.width[:, None, :]).reshape(-1, n_axes)
        event = np.repeat(leaves.event, len(offsets))
        log_volume = np.repeat(np.log(0.5 * leaves.width).sum(axis=1), len(offsets))
        predictions = self.predict(event, points)
        log_l = log_likelihoods(event, predictions, self.fronts.readings, self.fronts.errors)
        kept = log_l + self.log_envelope(points) > best[event] - self.resolution.depth
        log_weights = log_l + log_volume
        if n_axes > self.n_strengths:
            log_weights = log_weights + self.log_release(event, points[:, -1])
        else:
            points = np.column_stack([points, np.zeros(len(points))])
        return event[kept], points[kept], log_weights[kept]

    def release_range(self) -> tuple[FloatArray, FloatArray]:
        """Between which deviations each event's release is looked for: on the track, not moving up it."""
        low, high = self.fronts.releases.limits
        return np.maximum(-RELEASE_REACH, low), np.minimum(RELEASE_REACH, high)

    def log_release(self, events: IntArray, deviation: FloatArray) -> FloatArray:
        """Log density of a release's deviation, cut off at its limits."""
        low, high = (limit[events] for limit in self.fronts.releases.limits)
        return -0.5 * deviation**2 - 0.5 * math.log(2 * math.pi) - np.log(ndtr(high) - ndtr(low))


def stagger(events: IntArray, step: FloatArray) -> FloatArray:
    """How far each event's grid is moved, (n, n_strengths) in [0, step).

    With all nodes on one lattice a population narrower than that would gain from sitting on it, a
    little in every event; so it gains in some and loses in others.
    """
    golden = np.array([0.6180339887, 0.7548776662, 0.8191725134, 0.8566748838])
    shifts = golden[np.arange(len(step)) % len(golden)]
    result: FloatArray = step * np.mod((events[:, None] + 1.0) * shifts, 1.0)
    return result


def _grid(axes: list[FloatArray]) -> FloatArray:
    """All combinations of values on each axis, (n, n_axes), the last axis fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _sides(n_axes: int) -> IntArray:
    """Side of each corner on each axis, (2^n_axes, n_axes) of 0 and 1; bit j of its number is axis j."""
    return (np.arange(2**n_axes)[:, None] >> np.arange(n_axes)) & 1
