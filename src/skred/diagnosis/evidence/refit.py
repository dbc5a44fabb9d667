"""Population and events fitted at fixed strengths of what is added, with the evidence there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import batched
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, Rows, event_modes
from skred.diagnosis.evidence.event_quadrature import USUAL, Budget, Spread, event_nodes
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import median_log_scale
from skred.diagnosis.evidence.marginal import (
    Evidence,
    coordinates,
    evidence,
    importance_evidence,
    population_at,
)
from skred.diagnosis.evidence.tolerance import MOST_ROUNDS

MOST_NODES = 200_000
"""Quadrature points in memory together, but for those of one group at least: some hundred megabytes."""
_FAR = 0.5
"""Change of a population after which quadrature points are made anew: of its mean in spreads, and of a log
spread."""


class Fit(NamedTuple):
    """A law, perhaps extended, fitted at fixed strengths of what is added.

    Attributes
    ----------
    points : (n_events, n_base + 1) array
        The events' modes.
    """

    found: Evidence
    points: FloatArray

    @property
    def population(self) -> Population:
        """The most probable population."""
        return population_at(self.found.psi[None], self.points.shape[1] - 1)

    @property
    def start(self) -> tuple[Population, FloatArray]:
        """Population and events' points, where another refit can begin."""
        return self.population, self.points


class Rounds(NamedTuple):
    """How a refit goes on.

    Attributes
    ----------
    budget : Budget
        Quadrature points of the last round.
    first : Budget or None
        Of the rounds before, which only move the population there; None for the same.
    least : int
        Rounds that there are in any case; more where the population has moved far.
    sampled : bool
        Whether the evidence is computed by importance sampling; else by Laplace's formula.
    """

    budget: Budget = USUAL
    first: Budget | None = None
    least: int = 2
    sampled: bool = False


def refit(
    extension: Extension,
    rows: Rows,
    strengths: FloatArray,
    start: tuple[Population, FloatArray],
    rounds: Rounds,
    fits: Sequence[Fit] | None = None,
) -> list[Fit]:
    """Refit population and events at some strengths, one group of rows each.

    Parameters
    ----------
    rows : Rows
        The campaign's rows.
    strengths : (n_groups, n_directions) array
    start : (Population, (n_events, n_base + 1) array)
        Of one group: where to begin, and a population that quadrature points cover in any case.
    fits : sequence of Fit, optional
        Where to begin instead, one for each group.
    """
    n_groups, n_events, n = len(strengths), len(rows.event), start[0].mean.shape[1]
    log_scale = median_log_scale(extension.law)
    state = list(fits) if fits is not None else [Fit(unfitted(start[0]), start[1])] * n_groups
    active = list(range(n_groups))
    for number in range(MOST_ROUNDS):
        spent = rounds.budget if number > 0 or rounds.first is None else rounds.first
        at_once, moved = max(MOST_NODES // (n_events * spent.total), 1), list[int]()
        for some in map(list, batched(active, at_once)):
            likelihood = EventLikelihood(extension, rows, np.empty(0)).in_groups(strengths[some])
            population = population_at(np.stack([state[k].found.psi for k in some]), n)
            points = np.concatenate([state[k].points for k in some])
            modes = event_modes(likelihood, points, population, n_steps=6)
            spread = event_nodes(likelihood, population, modes, spent, start[0])
            of_each = (np.split(values, len(some)) for values in (*spread, modes.points))
            for k, nodes_at, log_weights, own in zip(some, *of_each, strict=True):
                nodes, before = Spread(nodes_at, log_weights).nodes, state[k].found.psi
                found = evidence(nodes, log_scale, before)
                if number + 1 < rounds.least or _moved(before, found.psi, n):
                    moved.append(k)
                if rounds.sampled and (k not in moved or number + 1 == MOST_ROUNDS):
                    found = importance_evidence(nodes, log_scale, found)
                state[k] = Fit(found, own)
        active = moved
        if not active:
            break
    return state


def unfitted(population: Population) -> Evidence:
    """A population to begin with."""
    psi = coordinates(population)
    return Evidence(-np.inf, psi, np.eye(len(psi)))


def _moved(before: FloatArray, after: FloatArray, n: int) -> bool:
    """Whether a population is far from the one that its nodes were made for."""
    mean = np.abs(after[:n] - before[:n]) / np.exp(before[n : 2 * n])
    spread = np.abs(after[n : 2 * n] - before[n : 2 * n])
    return bool(max(mean.max(), spread.max()) > _FAR)
