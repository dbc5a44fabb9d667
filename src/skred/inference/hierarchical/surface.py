"""Likelihood surfaces: each event's likelihood over its own parameters, as quadrature nodes.

An event's likelihood, as a function of that event's strengths and release, does not depend on the
population they come from. So it is resolved before sampling, by bisection of a wide box: a part is
dropped where even the best readings that its corners allow would be too unlikely, and halved
until the readings change by about a standard deviation across it. Nothing is missed between two modes
(reached, not reached), at kinks, or where the likelihood is a hundred times narrower than the
population, as long as readings are monotone within a part. What sampling then needs for a population
is a weighted sum over nodes, without another run of the kernel.

Coordinates are the logarithms of the strengths and, where the release is uncertain, its deviation in
standard deviations, whose normal density is part of the surface.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.inference.hierarchical.bisection import (
    RELEASE_REACH,
    Bisection,
    Envelope,
    Fronts,
    Resolution,
    stagger,
)

_EVENTS_AT_ONCE = 16
"""Events that are resolved together, between two reports of progress."""
_FIRST_WIDTH = 0.5
"""Widest first box, in the logarithm of a coefficient: wider ones hide a narrow mode."""


class Nodes(NamedTuple):
    """Nodes of all events as the compiled sums read them.

    Attributes
    ----------
    first : (n_events + 1,) integer array
        Where each event's nodes begin.
    points : (n_strengths, n_nodes) array
        Logarithms of the strengths.
    log_weights : (n_nodes,) array
    log_widths : (n_nodes,) or (0,) array
        Log of what each node stands for, where nodes lie so that a narrow population could have more than all
        of itself at them.
    """

    first: IntArray
    points: FloatArray
    log_weights: FloatArray
    log_widths: FloatArray


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Patches of the surfaces of all events, event after event.

    A patch gathers the quadrature nodes of a small cell, over which no population varies much, by
    their total weight and their first two moments.

    Attributes
    ----------
    first : (n_events + 1,) integer array
        Where each event's patches begin.
    log_weights : (n_patches,) array
        Log of the likelihood integrated over the patch.
    mean : (n_patches, n_strengths + 1) array
        Of the logarithms of the strengths and of the release's deviation in standard deviations.
    covariance : (n_patches, n_strengths + 1, n_strengths + 1) array
    n_runs : int
        Runs of the kernel it took.
    """

    first: IntArray
    log_weights: FloatArray
    mean: FloatArray
    covariance: FloatArray
    n_runs: int

    @property
    def n_patches(self) -> int:
        """Number of patches of all events."""
        return len(self.log_weights)

    @cached_property
    def nodes(self) -> Nodes:
        """Nodes with the weight and the moments of each patch: two on each principal axis."""
        n = self.mean.shape[1] - 1
        variance, axes = np.linalg.eigh(self.covariance[:, :n, :n])
        reach = axes * np.sqrt(n * np.maximum(variance, 0.0))[:, None, :]
        steps = np.concatenate([reach, -reach], axis=2).transpose(0, 2, 1)
        points = (self.mean[:, None, :n] + steps).reshape(-1, n)
        log_weights = np.repeat(self.log_weights - math.log(2 * n), 2 * n)
        return Nodes(2 * n * self.first, np.ascontiguousarray(points.T), log_weights, np.empty(0))


def build_surfaces(
    fronts: Fronts,
    box: FloatArray,
    resolution: Resolution,
    cell: FloatArray,
    envelope: Envelope | None = None,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> Surfaces:
    """Resolve the likelihood of every event.

    Parameters
    ----------
    fronts : Fronts
    box : (n_strengths, 2) array
        Range of the logarithm of each strength that is searched.
    resolution : Resolution
    cell : (n_strengths,) array
        Size of a patch at most: a population should vary little over it.
    envelope : Envelope, optional
        What a population could be at most; without it all of the box counts.
    tell : callable, optional
        Told the number of events done and of all.
    """
    uncertain = fronts.releases.uncertain
    n_events = len(uncertain)
    steps = (box[:, 1] - box[:, 0]) / np.ceil((box[:, 1] - box[:, 0]) / _FIRST_WIDTH)
    cell = steps * 0.5 ** np.ceil(np.log2(steps / cell))  # halvings of a first box
    chunks: list[IntArray] = []
    for group in (np.flatnonzero(~uncertain), np.flatnonzero(uncertain)):
        chunks += [group[k : k + _EVENTS_AT_ONCE] for k in range(0, len(group), _EVENTS_AT_ONCE)]

    def build(events: IntArray) -> Surfaces:
        bisection = Bisection(fronts, resolution, cell, envelope)
        edges = [_edges(low - step, high, step) for (low, high), step in zip(box, steps, strict=True)]
        if uncertain[events[0]]:
            edges.append(_edges(0.0, 1.0, resolution.release / (2.0 * RELEASE_REACH)))
        nodes = bisection.nodes(events, edges)
        origin = box[:, 0] - steps + stagger(np.arange(n_events), steps)
        return _patches(events, *nodes, origin, cell, bisection.n_runs)

    parts: list[Surfaces] = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for part in pool.map(build, chunks):
            parts.append(part)
            tell(min(len(parts) * _EVENTS_AT_ONCE, n_events), n_events)
    return _join(parts, np.concatenate(chunks))


def _edges(low: float, high: float, step: float) -> FloatArray:
    return np.linspace(low, high, max(int(math.ceil((high - low) / step)), 1) + 1)


def _patches(
    events: IntArray,
    event: IntArray,
    points: FloatArray,
    log_weights: FloatArray,
    origin: FloatArray,
    cell: FloatArray,
    n_runs: int,
) -> Surfaces:
    """Gather nodes by event and cell, into weights and moments."""
    cells = np.floor((points[:, :-1] - origin[event]) / cell).astype(np.int64).T
    lowest = cells.min(axis=1, keepdims=True)
    sizes = np.append(event.max() + 1, (cells - lowest).max(axis=1) + 1)
    # One number instead of a row: sorting rows takes ten times as long.
    keys = np.ravel_multi_index(np.vstack([event, cells - lowest]), sizes)
    found, group = np.unique(keys, return_inverse=True)
    event_found = np.unravel_index(found, sizes)[0]
    most = np.full(len(found), -np.inf)
    np.maximum.at(most, group, log_weights)
    weight = np.exp(log_weights - most[group])
    total = np.bincount(group, weight)
    n_axes = points.shape[1]
    mean = np.column_stack([np.bincount(group, weight * column) / total for column in points.T])
    deviation = points - mean[group]
    covariance = np.empty((len(found), n_axes, n_axes))
    for i in range(n_axes):
        for j in range(i + 1):
            moment = np.bincount(group, weight * deviation[:, i] * deviation[:, j]) / total
            covariance[:, i, j] = covariance[:, j, i] = moment
    first = np.append(np.searchsorted(event_found, events), len(found))
    return Surfaces(first, most + np.log(total), mean, covariance, n_runs)


def _join(parts: Sequence[Surfaces], order: IntArray) -> Surfaces:
    """Surfaces of all events in the events' own order."""
    shifts = np.cumsum([0] + [part.n_patches for part in parts[:-1]])
    starts = np.concatenate([part.first[:-1] + shift for part, shift in zip(parts, shifts, strict=True)])
    sizes = np.concatenate([np.diff(part.first) for part in parts])
    place = np.argsort(order)
    rows = np.concatenate([np.arange(starts[k], starts[k] + sizes[k]) for k in place])
    return Surfaces(
        np.concatenate([[0], np.cumsum(sizes[place])]),
        np.concatenate([part.log_weights for part in parts])[rows],
        np.concatenate([part.mean for part in parts])[rows],
        np.concatenate([part.covariance for part in parts])[rows],
        sum(part.n_runs for part in parts),
    )
