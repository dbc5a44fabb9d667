"""The mean of the evidence over where a stretch is: linear, on a log scale, between the places looked at.

A mechanism's prior is uniform in the end of its stretch and in the logarithm of its length. The places that
were looked at, and the corners of what may be with what is nearest to them, are corners of triangles, or of
intervals where they lie on a line, and over each of these a rule of quadrature sums the evidence.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import Delaunay, KDTree

from skred.arrays import FloatArray
from skred.physics.mechanisms.spec import Setting, Shape
from skred.physics.mechanisms.stretches import ends_of

_SAME = 9
"""Decimals to which two places in a unit square, or two lengths, are the same: computed in two ways."""
_POINTS = 16
"""Of the quadrature rule on a triangle, along each axis: right to a hundredth where corners are 60 nats
apart, and what is so far below its neighbours adds nothing."""


class Area(NamedTuple):
    """Where a mechanism of one kind may be: ends [m] and logarithms of lengths, from and to.

    Attributes
    ----------
    low, high : (2,) array
    """

    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, shapes: list[Shape], setting: Setting) -> Area:
        """Of shapes looked at first: it ends in the recorded part, at lengths half a step beyond theirs."""
        at = _coordinates(shapes)
        ends, longest = [*setting.recorded_m, *at[:, 0]], at[:, 1].max()
        # A stretch that the track's beginning cuts off is no length that was chosen, but for the longest.
        whole = np.array([ends_of(one)[0] > 0.0 for one in shapes]) | (at[:, 1] == longest)
        lengths = np.unique(at[whole, 1].round(_SAME))
        beyond = 0.5 * (np.diff(lengths).max() if len(lengths) > 1 else 1.0)
        return cls(np.array([min(ends), lengths[0] - beyond]), np.array([max(ends), lengths[-1] + beyond]))

    def shape(self, within: FloatArray) -> Shape:
        """The stretch at a place from 0 to 1 along both axes, cut off where the track begins."""
        last, log_length = self.low + within * (self.high - self.low)
        return Shape(max(float(last - np.exp(log_length)), 0.0), float(last))

    def within(self, shapes: list[Shape]) -> FloatArray:
        """Places of shapes in it, (n, 2): from 0 to 1 along both axes."""
        span = self.high - self.low
        return np.asarray((_coordinates(shapes) - self.low) / np.where(span > 0.0, span, 1.0))


class OverPlaces(NamedTuple):
    """The mean of the evidence over an area, by the shapes that were looked at.

    Attributes
    ----------
    log_means : (n,) array
        Log of what each shape adds to the mean.
    log_weights : (n,) array
        Log of each shape's part of the area, times one number for all that makes them give the same mean:
        weights that stay near the truth where the evidence becomes another one.
    """

    log_means: FloatArray
    log_weights: FloatArray


def over_places(area: Area, shapes: list[Shape], heights: FloatArray) -> OverPlaces:
    """The mean of the evidence over an area.

    Parameters
    ----------
    shapes : list of Shape
        Those beside the area count for what lies between them and the others.
    heights : (n,) array
        Log evidence of each.
    """
    at = area.within(shapes)
    places, of = np.unique(at[:, np.ptp(at, axis=0) > 10.0**-_SAME].round(_SAME), axis=0, return_inverse=True)
    # Shapes at one place, a stretch opposed by more and by less, share it.
    many = np.bincount(of)
    height = np.full(len(places), -np.inf)
    np.logaddexp.at(height, of, heights)
    height -= np.log(many)
    log_means, log_parts = _over_simplices(places, height)
    own = heights - np.log(many[of]) - height[of] + log_means[of]
    log_weights = log_parts[of] - np.log(many[of])
    same = np.logaddexp.reduce(own) - np.logaddexp.reduce(log_weights + heights)
    return OverPlaces(own, log_weights + same)


def _over_simplices(places: FloatArray, heights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Logs of what each place adds to the mean and of its part, all different; (n, d), (n,) to (n,), (n,)."""
    d = places.shape[1]
    if d == 0:
        return heights, np.zeros(1)
    corners = np.array(list(product((0.0, 1.0), repeat=d)))
    nearest = KDTree(places).query(corners)[1]  # a corner of what may be has what is nearest to it
    points, of = np.vstack([places, corners]), np.append(np.arange(len(places)), nearest)
    simplices = Delaunay(points).simplices if d > 1 else sliding_window_view(np.argsort(points[:, 0]), 2)
    sides = points[simplices[:, 1:]] - points[simplices[:, :1]]
    at, weights = _rule(d)
    own, top = heights[of[simplices]], float(heights.max())
    where = at @ points[simplices]
    inside = ((where >= 0.0) & (where <= 1.0)).all(axis=2)
    parts = inside * weights * np.abs(np.linalg.det(sides))[:, None]
    found = np.zeros((2, len(places)))
    np.add.at(found[0], of[simplices], (parts * np.exp(own @ at.T - top)) @ at)
    np.add.at(found[1], of[simplices], parts @ at)
    logs = np.log(np.maximum(found, np.finfo(float).tiny))
    return logs[0] + top, logs[1]


@cache
def _rule(d: int) -> tuple[FloatArray, FloatArray]:
    """Points of a quadrature rule on a simplex by barycentric coordinates, (n, d + 1), and their weights.

    Gauss's along each axis of a cube that has one side drawn together (Duffy, 1982, doi 10.1137/0719090).
    """
    at, weights = np.ones((1, 1)), np.ones(1)
    nodes, own = np.polynomial.legendre.leggauss(_POINTS)
    nodes, own = 0.5 * (nodes + 1.0), 0.5 * own
    for axis in range(d):
        inner = (nodes[:, None, None] * at).reshape(-1, axis + 1)
        at = np.column_stack([np.repeat(1.0 - nodes, len(at)), inner])
        weights = ((own * nodes**axis)[:, None] * weights).ravel()
    return at, weights


def _coordinates(shapes: list[Shape]) -> FloatArray:
    """End [m] and logarithm of the length of each shape's stretch, (n, 2)."""
    first, last = np.array([ends_of(one) for one in shapes]).T
    return np.column_stack([last, np.log(last - first)])
