"""Quadrature on a line: where an event has one free strength, trapezoids between well chosen points.

Over one strength an event's likelihood is mostly smooth. It has jumps where its front just passes or just
stops, and spikes as narrow as a hundredth of its population beside them. Random points miss the spikes and
know jumps no better than the distance between them. Points put between those that differ most close in on
both.

A population narrower than the distance between points has more than all of itself at one, the same for all
avalanches that know little. So the widths of points are given, too, by which that shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from skred.arrays import FloatArray
from skred.parallel.compile_cache import compiled, inner

_PER_ROOT = 7.0
"""Nodes on a line for the root of as many others: their error falls with the square of the number. Where they
are few a population seems to be more than all of itself; what recordings tell much of loses by that."""
_REACH = 3.0
"""How far the first nodes go from each centre, in widths."""
_TURNS = 2
"""Turns in which half of the points are put between those before: a second one closes in on spikes."""
_AS_WIDE = 0.1
"""What width alone counts for, against a change as large as what is there."""


def line_nodes(
    log_likelihoods: Callable[[FloatArray], FloatArray],
    centres: FloatArray,
    widths: FloatArray,
    populations: tuple[FloatArray, FloatArray],
    others: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes of all rows in order along the line, their log weights and log widths, (n_rows, n_nodes) each.

    Half of them lie evenly around the centres. The others are put in turns between those before, by how
    much an event's own density changes from one to the next and how far they are apart, in each population.

    Parameters
    ----------
    log_likelihoods : callable
        Of points, (n_rows, k) to (n_rows, k).
    centres, widths : (n_rows, n_centres) arrays
        Of what the nodes must cover.
    populations : ((n_rows, n_populations) array, (n_rows, n_populations) array)
        Means and standard deviations of the strength: its own, which counts as much as all others together.
    others : int
        How many importance nodes there would be.
    """
    size = _PER_ROOT * math.sqrt(others)
    each = max(math.ceil(0.5 * size / centres.shape[1]), 2)
    # Each at least as far as to all others, in steps that grow with the way: no narrow gathering of nodes has
    # an edge that stands for all of a gap beside it.
    farthest = np.abs(centres[:, :, None] - centres[:, None, :]).max(axis=2)
    reach = np.maximum(farthest / widths, _REACH)
    ways = np.sinh(np.arcsinh(reach)[:, :, None] * np.linspace(-1.0, 1.0, each))
    points = centres[:, :, None] + widths[:, :, None] * ways
    points = np.sort(points.reshape(len(centres), -1), axis=1)
    log_l = log_likelihoods(points)
    for _ in range(_TURNS):
        new = _between(points, log_l, *populations, math.ceil(0.5 * size / _TURNS))
        points, log_l = np.hstack([points, new]), np.hstack([log_l, log_likelihoods(new)])
        order = np.argsort(points, axis=1, kind="stable")
        points, log_l = np.take_along_axis(points, order, axis=1), np.take_along_axis(log_l, order, axis=1)
    apart = np.diff(points, axis=1)
    widths_of = np.zeros_like(points)
    widths_of[:, :-1] += 0.5 * apart
    widths_of[:, 1:] += 0.5 * apart
    log_widths = np.log(np.maximum(widths_of, np.finfo(float).tiny))
    return points, log_l + log_widths, log_widths


@inner()
def _add_changes(points, height, share, changes):  # type: ignore[no-untyped-def]
    """What is between each point and the one before it counts for, of the share that they have together."""
    most, total = height.max(), 0.0
    own = np.zeros(points.size)
    before = math.exp(height[0] - most)
    for k in range(1, points.size):
        after, apart = math.exp(height[k] - most), points[k] - points[k - 1]
        own[k] = apart * (abs(after - before) + _AS_WIDE * max(after, before))
        total += own[k]
        before = after
    if total > 0.0:
        changes += share / total * own


@compiled()
def _between(points, log_l, means, sds, n):  # type: ignore[no-untyped-def]
    """New points of each row, (n_rows, n), between points in order whose log likelihoods are given."""
    n_rows, n_points = points.shape
    n_populations = means.shape[1]
    result, height, reached = np.empty((n_rows, n)), np.empty(n_points), np.empty(n_points)
    for row in range(n_rows):
        reached[:] = 0.0
        for one in range(n_populations):
            for k in range(n_points):
                height[k] = log_l[row, k] - 0.5 * ((points[row, k] - means[row, one]) / sds[row, one]) ** 2
            share = 1.0 if one == 0 else 1.0 / (n_populations - 1)
            _add_changes(points[row], height, share, reached)
        for k in range(1, n_points):
            reached[k] += reached[k - 1]
        k = 1
        for j in range(n):
            target = (j + 0.5) / n * reached[-1]
            while k < n_points - 1 and reached[k] < target:
                k += 1
            gap = reached[k] - reached[k - 1]
            share = (target - reached[k - 1]) / gap if gap > 0.0 else 0.5
            result[row, j] = points[row, k - 1] + share * (points[row, k] - points[row, k - 1])
    return result
