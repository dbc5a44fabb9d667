"""Integrated log densities of a law with mechanisms added, interpolated between tables of quadrature points.

Tables stand on a grid of the added strengths, skewed where two go together. Between them the log
density of each event is interpolated by cubic polynomials, along every axis through the four tables nearest.
It bends least along the ridge, where the population follows what is added: a drag that friction has absorbed
comes in while friction falls to a third. So each table is asked at the population moved by as much as the one
that it was made around differs from those of its neighbours, interpolated in the same way.
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

_WALL = 12.0
"""Nats that all events lose a step outside the tables: chains turn back, and yet find in from anywhere."""
_OVERSHOOT = 0.5
"""How far beyond the densities at the tables an interpolated one may be, in nats."""


@inner()
def _cubic_weights(place, size, weights):  # type: ignore[no-untyped-def]
    """Fill the weights of four neighbours on the grid 0, 1, ..., size - 1; returns the first of them."""
    lowest = int(min(max(math.floor(place) - 1.0, 0.0), size - 4.0))
    t = place - lowest
    weights[0] = -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0
    weights[1] = t * (t - 2.0) * (t - 3.0) / 2.0
    weights[2] = -t * (t - 1.0) * (t - 3.0) / 2.0
    weights[3] = t * (t - 1.0) * (t - 2.0) / 6.0
    return lowest


@inner()
def _neighbours(own, origin, steps, bends, size):  # type: ignore[no-untyped-def]
    """Numbers of the tables around some added strengths, their weights, and how many tables outside."""
    n_axes = own.size
    along, lowest = np.empty((n_axes, 4)), np.empty(n_axes, np.int64)
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
        lowest[axis] = _cubic_weights(inside, size[axis], along[axis])
    tables, weights = np.zeros(4**n_axes, np.int64), np.ones(4**n_axes)
    for corner in range(4**n_axes):
        rest = corner
        for axis in range(n_axes):
            tables[corner] = tables[corner] * size[axis] + lowest[axis] + rest % 4
            weights[corner] *= along[axis, rest % 4]
            rest //= 4
    return tables, weights, outside


@inner()
def _interpolated(  # type: ignore[no-untyped-def]
    own,
    known,
    at_tables,
    means,
    factor,
    origin,
    steps,
    bends,
    size,
    centres,
    first,
    points,
    log_weights,
    density,
):
    """Fill the log density of each event that has some added strengths; tables asked for are kept."""
    n_events = density.size
    least, most = np.full(n_events, np.inf), np.full(n_events, -np.inf)
    tables, weights, outside = _neighbours(own, origin, steps, bends, size)
    centre = np.zeros(means.shape[1])
    for corner in range(tables.size):
        centre += weights[corner] * centres[tables[corner]]
    density[:] = 0.0
    for corner in range(tables.size):
        if abs(weights[corner]) < 1e-12:
            continue
        table = tables[corner]
        if not known[table]:
            of_table = first[table * n_events : (table + 1) * n_events + 1]
            moved = means + (centres[table] - centre)
            at_tables[table] = integrated_log_density(moved, factor, of_table, points, log_weights)
            known[table] = True
        for event in range(n_events):
            there = at_tables[table, event]
            density[event] += weights[corner] * there
            least[event] = min(least[event], there)
            most[event] = max(most[event], there)
    # Far from all nodes tables differ by hundreds, and polynomials through them overshoot.
    for event in range(n_events):
        density[event] = min(max(density[event], least[event] - _OVERSHOOT), most[event] + _OVERSHOOT)
        density[event] -= _WALL * outside / n_events


@inner()
def _components(  # type: ignore[no-untyped-def]
    means, factor, strengths, origin, steps, bends, size, centres, first, points, log_weights, densities
):
    """Fill the log density of each event with each of some added strengths, (n_components, n_events)."""
    n_tables, one_centre = len(centres), np.all(centres == centres[0])
    known, at_tables = np.zeros(n_tables, np.bool_), np.empty((n_tables, means.shape[0]))
    for component in range(len(strengths)):
        if not one_centre:
            known[:] = False  # what was kept is of a population moved otherwise
        _interpolated(
            strengths[component], known, at_tables, means, factor, origin, steps, bends, size, centres, first,
            points, log_weights, densities[component],
        )  # fmt: skip


@compiled()
def tabulated_log_density(  # type: ignore[no-untyped-def]
    means, factor, strengths, log_shares, origin, steps, bends, size, centres, first, points, log_weights
):
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

    Returns
    -------
    (n_events,) array
        Outside the tables those at their edge, less what turns a chain back.
    """
    n_events, n_components = means.shape[0], log_shares.size
    densities = np.empty((n_components, n_events))
    _components(
        means, factor, strengths, origin, steps, bends, size, centres, first, points, log_weights, densities
    )
    total = np.full(n_events, -np.inf)
    for component in range(n_components):
        for event in range(n_events):
            total[event] = np.logaddexp(total[event], log_shares[component] + densities[component, event])
    return total


@compiled()
def tabulated_log_densities(  # type: ignore[no-untyped-def]
    means, factors, strengths, n_events, origin, steps, bends, size, centres, first, points, log_weights
):
    """Each event's log density with each component, for many draws: (n, n_components, n_events).

    As `tabulated_log_density`, with a mean, a factor and strengths (n_components, n_added) for each draw.
    """
    result = np.empty((len(means), strengths.shape[1], n_events))
    of_event = np.empty((n_events, means.shape[1]))
    for k in range(len(means)):
        of_event[:] = means[k]
        _components(
            of_event, factors[k], strengths[k], origin, steps, bends, size, centres, first, points,
            log_weights, result[k],
        )  # fmt: skip
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
