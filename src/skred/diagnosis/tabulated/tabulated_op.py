"""Integrated log densities of a law with mechanisms added, interpolated between tables of quadrature points.

Tables stand on a grid of the added strengths, skewed where two go together. Between them the log
density of each event is interpolated by cubic polynomials that bend gently, along every axis through the four
tables nearest. Those of any bend overshoot by hundreds of nats where a density falls off a cliff, as beyond
the strength that leaves nothing of the base's; monotone ones flatten every maximum. It bends least along the
ridge, where the population follows what is added: a drag that friction has absorbed comes in while friction
falls to a third. So each table is asked at the population moved by as much as the one that it was made around
differs from those of its neighbours, interpolated in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pytensor.graph.basic import Variable
from pytensor.link.numba.dispatch.basic import numba_njit, register_funcify_default_op_cache_key

from skred.inference.array_op import ArrayOp
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.parallel.compile_cache import cache_key, compiled, inner

_MOST_BENT = 1.0
"""Nats that a second difference counts at most: as of an avalanche that alone knows a strength to a step
between tables. More is a cliff's edge."""
_WALL = 12.0
"""Nats that all events lose a step outside the tables: chains turn back, and yet find in from anywhere."""


@inner()
def _bend(values, middle):  # type: ignore[no-untyped-def]
    """Second difference around a value, as far as it counts."""
    bend = values[middle - 1] - 2.0 * values[middle] + values[middle + 1]
    return min(max(bend, -_MOST_BENT), _MOST_BENT)


@inner()
def _gently_bent(values, start, t):  # type: ignore[no-untyped-def]
    """Between four values, t steps from the first of them: cubic polynomials where they bend gently.

    Nowhere farther from the straight line than an eighth of what a second difference counts at most.
    """
    cell = min(int(t), 2)
    low, share = start + cell, t - cell
    here, there = _bend(values, low + (cell == 0)), _bend(values, low + (cell < 2))
    left, rise = 1.0 - share, values[low + 1] - values[low]
    return values[low] + share * rise - share * left / 6.0 * ((1.0 + left) * here + (1.0 + share) * there)


@inner()
def _between(values, t):  # type: ignore[no-untyped-def]
    """Between values at the corners, (4^n_axes,), along one axis after the other; `values` is used up."""
    left = values.size
    for axis in range(t.size):
        left //= 4
        for k in range(left):
            values[k] = _gently_bent(values, 4 * k, t[axis])
    return values[0]


@inner()
def _neighbours(own, origin, steps, bends, size):  # type: ignore[no-untyped-def]
    """Numbers of the tables at the corners around some added strengths, and how many tables outside.

    With the way from the first of them along each axis; a corner that nothing hangs on has the number -1.
    """
    n_axes = own.size
    t, lowest = np.empty(n_axes), np.empty(n_axes, np.int64)
    place, outside = np.empty(n_axes), 0.0
    for axis in range(n_axes):
        place[axis] = own[axis] - origin[axis]
        for before in range(axis):
            place[axis] -= steps[axis, before] * place[before]
        place[axis] /= steps[axis, axis]
    for axis in range(n_axes):
        if bends[axis] != 0.0:
            place[axis] = math.asinh(bends[axis] * place[axis]) / bends[axis]
        inside = min(max(place[axis], 0.0), size[axis] - 1.0)
        outside += abs(place[axis] - inside)
        lowest[axis] = int(min(max(math.floor(inside) - 1.0, 0.0), size[axis] - 4.0))
        t[axis] = inside - lowest[axis]
    tables = np.zeros(4**n_axes, np.int64)
    for corner in range(4**n_axes):
        rest, counts = corner, True
        for axis in range(n_axes):
            tables[corner] = tables[corner] * size[axis] + lowest[axis] + rest % 4
            counts = counts and (t[axis] != math.floor(t[axis]) or rest % 4 == t[axis])
            rest //= 4
        if not counts:
            tables[corner] = -1
    return tables, t, outside


@inner()
def _interpolated(own, known, at_tables, means, factor, tables, density):  # type: ignore[no-untyped-def]
    """Fill the log density of each event that has some added strengths; tables asked for are kept."""
    origin, steps, bends, size, centres, first, points, log_weights, log_widths = tables
    n_events = density.size
    corners, t, outside = _neighbours(own, origin, steps, bends, size)
    centre, values = np.empty(means.shape[1]), np.zeros(corners.size)
    for i in range(centre.size):
        for corner in range(corners.size):
            if corners[corner] >= 0:
                values[corner] = centres[corners[corner], i]
        centre[i] = _between(values, t)
    for table in corners:
        if table >= 0 and not known[table]:
            of_table = first[table * n_events : (table + 1) * n_events + 1]
            moved = means + (centres[table] - centre)
            at_tables[table] = integrated_log_density(
                moved, factor, of_table, points, log_weights, log_widths
            )
            known[table] = True
    for event in range(n_events):
        for corner in range(corners.size):
            values[corner] = at_tables[corners[corner], event] if corners[corner] >= 0 else 0.0
        density[event] = _between(values, t) - _WALL * outside / n_events


@inner()
def _components(means, factor, strengths, tables, densities):  # type: ignore[no-untyped-def]
    """Fill the log density of each event with each of some added strengths, (n_components, n_events)."""
    centres = tables[4]
    n_tables, one_centre = len(centres), np.all(centres == centres[0])
    known, at_tables = np.zeros(n_tables, np.bool_), np.empty((n_tables, means.shape[0]))
    for component in range(len(strengths)):
        if not one_centre:
            known[:] = False  # what was kept is of a population moved otherwise
        own = strengths[component]
        _interpolated(own, known, at_tables, means, factor, tables, densities[component])


@compiled()
def tabulated_log_density(means, factor, strengths, log_shares, *tables):  # type: ignore[no-untyped-def]
    """Log likelihood of each event, its own strengths integrated over the population.

    Parameters
    ----------
    means : (n_events, n_strengths) array
        Population mean of the logarithms of the base's strengths, for each event.
    factor : (n_strengths, n_strengths) array
        Lower Cholesky factor of their covariance.
    strengths : (n_components, n_added) array
        Added strengths that an event may have.
    log_shares : (n_components,) array
        Logarithm of the share of events that have each.
    *tables
        `Tables.arrays`, which are the following.
    origin : (n_added,) array
        Strengths of the first table.
    steps : (n_added, n_added) array
        Lower triangular: each column is the step from table to table along an axis.
    bends : (n_added,) array
        How steps grow along each axis: see `Grid`.
    size : (n_added,) integer array
        Tables along each axis, at least four.
    centres : (n_tables, n_strengths) array
        Population mean that each table was made around, the last axis of the tables running fastest.
    first : (n_tables * n_events + 1,) integer array
        Where the nodes of each table's events begin.
    points : (n_strengths, n_nodes) array
    log_weights : (n_nodes,) array
    log_widths : (n_nodes,) or (0,) array
        As in `surface.Nodes`.

    Returns
    -------
    (n_events,) array
        Outside the tables those at their edge, less what turns a chain back.
    """
    n_events, n_components = means.shape[0], log_shares.size
    densities = np.empty((n_components, n_events))
    _components(means, factor, strengths, tables, densities)
    total = np.full(n_events, -np.inf)
    for component in range(n_components):
        for event in range(n_events):
            total[event] = np.logaddexp(total[event], log_shares[component] + densities[component, event])
    return total


@compiled()
def tabulated_log_densities(means, factors, strengths, n_events, *tables):  # type: ignore[no-untyped-def]
    """Each event's log density with each component, for many draws: (n, n_components, n_events).

    As `tabulated_log_density`, with a mean, a factor and strengths (n_components, n_added) for each draw.
    """
    result = np.empty((len(means), strengths.shape[1], n_events))
    of_event = np.empty((n_events, means.shape[1]))
    for k in range(len(means)):
        of_event[:] = means[k]
        _components(of_event, factors[k], strengths[k], tables, result[k])
    return result


class TabulatedLogDensity(ArrayOp):
    """Log density of each event, (n_events,), from population, added strengths and tables of nodes.

    See `tabulated_log_density`. It has no gradient: sample with Metropolis or SMC.
    """

    array_inputs = (
        ("means", 2, "float64"),
        ("factor", 2, "float64"),
        ("strengths", 2, "float64"),
        ("log_shares", 1, "float64"),
        ("origin", 1, "float64"),
        ("steps", 2, "float64"),
        ("bends", 1, "float64"),
        ("size", 1, "int64"),
        ("centres", 2, "float64"),
        ("first", 1, "int64"),
        ("points", 2, "float64"),
        ("log_weights", 1, "float64"),
        ("log_widths", 1, "float64"),
    )
    differentiable = frozenset({"means", "factor", "strengths", "log_shares"})

    def output_shape(self, shapes: Sequence[tuple[Any, ...]]) -> tuple[Any, ...]:
        """(n_events,)."""
        return (shapes[0][0],)

    def evaluate(self, inputs: Sequence[Any]) -> Any:
        """Log densities from numpy arrays."""
        return tabulated_log_density(*inputs)

    def pullback(
        self, inputs: Sequence[Variable], outputs: Sequence[Variable], cotangents: Sequence[Variable]
    ) -> list[Variable]:
        """Not there.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError("TabulatedLogDensity has no gradient: use Metropolis for a law with mechanisms added")


@register_funcify_default_op_cache_key(TabulatedLogDensity)
def _funcify(op: TabulatedLogDensity, node: Any = None, **kwargs: Any) -> Any:
    @numba_njit
    def tabulated_density(*inputs):  # type: ignore[no-untyped-def]
        return tabulated_log_density(*inputs)

    return tabulated_density, cache_key(tabulated_log_density)
