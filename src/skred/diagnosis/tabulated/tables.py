"""Tables of quadrature points on a grid of added strengths that covers their posterior."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, event_modes, log_joint
from skred.diagnosis.evidence.event_quadrature import Budget, Spread, event_nodes
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.marginal import population_at, wide_populations
from skred.diagnosis.evidence.refit import MOST_NODES
from skred.diagnosis.tabulated.coefficient_grid import Grid, Located
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.inference.hierarchical.surface import Nodes
from skred.parallel.threads import in_parts, side_by_side

_MOST_TABULATED = 30_000_000
"""Quadrature points in all tables, a gigabyte; where there would be more each avalanche has fewer."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Nodes at each strength of a grid.

    Attributes
    ----------
    located : Located
    nodes : Nodes
        Of all events at the first strengths, then at the next, ...
    release : (n_nodes,) array
        The release's deviation at each node, in standard deviations.
    modes : (n_tables, n_events, n_base + 1) array
        Most probable points of the events.
    budget : Budget
        As was asked for.
    """

    located: Located
    nodes: Nodes
    release: FloatArray
    modes: FloatArray
    budget: Budget

    @property
    def grid(self) -> Grid:
        """The strengths that there are nodes at."""
        return self.located.grid

    @property
    def arrays(self) -> dict[str, Any]:
        """What the compiled interpolation reads, by name."""
        return {**self.grid._asdict(), "centres": self.located.centres, **self.nodes._asdict()}


def build_tables(
    base: Base, extension: Extension, located: Located, budget: Budget, visited: Population | None = None
) -> Tables:
    """Nodes of all events at all strengths of a grid, around populations as wide as what is known of them.

    Parameters
    ----------
    visited : Population, optional
        Others that the nodes must cover, one or more groups.
    """
    grid, fits = located.grid, located.fits
    n, n_tables, n_events = len(base.law.mechanisms), len(fits), len(base.rows.event)
    likelihood = EventLikelihood(extension, base.rows, base.strengths).in_groups(base.given(grid.points))
    population = population_at(np.stack([fit.found.psi for fit in fits]), n)
    given = budget
    while n_tables * n_events * given.total > _MOST_TABULATED:
        given = given.halved
    start = highest(likelihood, np.stack([fit.points for fit in fits]), population)
    reference = base.population if visited is None else base.population.with_more(visited)
    around = wide_populations([fit.found for fit in fits], n)

    def spread(part: slice) -> tuple[Spread, FloatArray]:
        own = likelihood.part(part)
        modes = event_modes(own, start[part], population, n_steps=8)
        return event_nodes(own, around, modes, given, reference), modes.points

    spreads, modes = zip(*side_by_side(spread, _lots(n_tables, n_events, given)), strict=True)
    nodes, points = Spread.joined(spreads), np.concatenate(modes).reshape(n_tables, n_events, n + 1)
    return Tables(located, nodes.nodes, nodes.points[:, :, n].ravel(), points, budget)


def highest(likelihood: EventLikelihood, points: FloatArray, population: Population) -> FloatArray:
    """The highest of the modes found from each table's own points and from its neighbours', as rows.

    Avalanches that stop at a place or pass it have two modes, and a table that is in the lower one of an
    event would stand out between its neighbours.

    Parameters
    ----------
    points : (n_tables, n_events, n_base + 1) array
    """

    def climbed(start: FloatArray) -> tuple[FloatArray, FloatArray]:
        def climb(part: slice) -> tuple[FloatArray, FloatArray]:
            own = likelihood.part(part)
            top = event_modes(own, start[part], population, n_steps=8).points
            return top, log_joint(own, top, population)

        tops, heights = zip(*side_by_side(climb, in_parts(len(start))), strict=True)
        return np.concatenate(tops), np.concatenate(heights)

    best, height = climbed(points.reshape(-1, points.shape[-1]))
    found = best.reshape(points.shape)
    for side in (1, -1):
        tried, new = climbed(np.roll(found, side, axis=0).reshape(best.shape))
        best = np.where((new > height)[:, None], tried, best)
        height = np.maximum(new, height)
    return best


def exact_log_densities(
    likelihood: EventLikelihood,
    means: FloatArray,
    factors: FloatArray,
    start: FloatArray,
    budget: Budget,
    reference: Population,
    shifts: FloatArray | None = None,
) -> FloatArray:
    """Log densities of events by nodes for each of some populations themselves, (n_groups, n_rows).

    Parameters
    ----------
    likelihood : EventLikelihood
        One group of rows for each population.
    means, factors : (n_groups, n_base) and (n_groups, n_base, n_base) arrays
        Populations: the mean, and the lower Cholesky factor of the covariance.
    start : (n_groups, n_rows, n_base + 1) array
        Points near the modes.
    reference : Population
        As in `event_nodes`.
    shifts : (n_groups * n_rows, n_base + 1) array, optional
        As in `event_nodes`.
    """
    n_groups, n_rows, size = start.shape
    population, at = Population(means, factors @ factors.transpose(0, 2, 1)), start.reshape(-1, size)

    def spread(part: slice) -> Spread:
        own = likelihood.part(part)
        modes = event_modes(own, at[part], population)
        shifted = None if shifts is None else shifts[part]
        return event_nodes(own, population, modes, budget, reference, shifted)

    nodes = Spread.joined(side_by_side(spread, _lots(n_groups, n_rows, budget))).nodes
    result = np.empty((n_groups, n_rows))
    for k, (mean, factor) in enumerate(zip(means, factors, strict=True)):
        first = nodes.first[k * n_rows : (k + 1) * n_rows + 1]
        of_rows = np.tile(mean, (n_rows, 1))
        result[k] = integrated_log_density(of_rows, factor, *nodes._replace(first=first))
    return result


def _lots(n_groups: int, n_events: int, budget: Budget) -> list[slice]:
    """Rows of all groups, so many groups at a time as have points that memory is no matter."""
    at_once = max(MOST_NODES // (n_events * budget.total), 1)
    lots = in_parts(n_groups, math.ceil(n_groups / at_once))
    return [slice(n_events * lot.start, n_events * lot.stop) for lot in lots]
