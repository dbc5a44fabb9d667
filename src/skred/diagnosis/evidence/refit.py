"""Population and events fitted at fixed strengths of what is added, with the evidence there."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import batched
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Population,
    Rows,
    event_modes,
    lost_rows,
)
from skred.diagnosis.evidence.event_quadrature import USUAL, Budget, Spread, event_nodes
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import fit_population, mean_prior, median_log_scale
from skred.diagnosis.evidence.marginal import (
    Evidence,
    coordinates,
    evidence,
    importance_evidence,
    population_at,
    wide_populations,
)
from skred.diagnosis.evidence.tolerance import MOST_ROUNDS
from skred.inference.hierarchical.rough_population import STARTING_SPREAD
from skred.inference.hierarchical.surface import Nodes

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
    state = list(fits) if fits is not None else [Fit(unfitted(start[0]), start[1])] * n_groups
    active = list(range(n_groups))
    for number in range(MOST_ROUNDS):
        spent = rounds.budget if number > 0 or rounds.first is None else rounds.first
        at_once, moved = max(MOST_NODES // (n_events * spent.total), 1), list[int]()
        for some in map(list, batched(active, at_once)):
            likelihood = EventLikelihood(extension, rows, np.empty(0)).in_groups(strengths[some])
            begin = [state[k] for k in some]
            found = _round(likelihood, begin, spent, start[0])
            if number == 0:
                found = _led_on(likelihood, found, spent, start[0])
            for of, (k, before, (after, nodes)) in enumerate(zip(some, begin, found, strict=True)):
                if number + 1 < rounds.least or _moved(before.found.psi, after.found.psi, n):
                    moved.append(k)
                if rounds.sampled and (k not in moved or number + 1 == MOST_ROUNDS):
                    after = _sampled(likelihood.of_groups(np.array([of])), after, nodes, spent, start[0])
                state[k] = after
        active = moved
        if not active:
            break
    return state


def _round(
    likelihood: EventLikelihood,
    begin: Sequence[Fit],
    budget: Budget,
    reference: Population,
    around: Population | None = None,
) -> list[tuple[Fit, Nodes]]:
    """One round of a refit: the events' modes, quadrature points around them, the population by these.

    Parameters
    ----------
    likelihood : EventLikelihood
        Of as many groups of rows as there are fits.
    around : Population, optional
        Where points are put; without, around the fits' most probable ones.
    """
    n, n_groups = begin[0].points.shape[1] - 1, len(begin)
    log_scale = median_log_scale(likelihood.extension.law)
    population = population_at(np.stack([fit.found.psi for fit in begin]), n) if around is None else around
    points = np.concatenate([fit.points for fit in begin])
    modes = event_modes(likelihood, points, population, n_steps=6)
    spread = event_nodes(likelihood, population, modes, budget, reference)
    nodes = [Spread(*part).nodes for part in zip(*(np.split(one, n_groups) for one in spread), strict=True)]
    found = [evidence(one, log_scale, fit.found.psi) for one, fit in zip(nodes, begin, strict=True)]
    fits = [Fit(*one) for one in zip(found, np.split(modes.points, n_groups), strict=True)]
    return list(zip(fits, nodes, strict=True))


def _sampled(
    likelihood: EventLikelihood, fit: Fit, nodes: Nodes, budget: Budget, reference: Population
) -> Fit:
    """A fit of one group with evidence by importance sampling, by points around all populations that may be.

    Around the most probable population alone points miss what an avalanche does under wider ones.
    """
    log_scale = median_log_scale(likelihood.extension.law)
    found = importance_evidence(nodes, log_scale, fit.found)
    around = wide_populations([found], fit.points.shape[1] - 1)
    [(again, nodes)] = _round(likelihood, [fit], budget, reference, around)
    return again._replace(found=importance_evidence(nodes, log_scale, again.found))


def _led_on(
    likelihood: EventLikelihood,
    found: Sequence[tuple[Fit, Nodes]],
    budget: Budget,
    reference: Population,
) -> list[tuple[Fit, Nodes]]:
    """Where fronts are far from their readings begun once more, with the populations that events ask for.

    From a narrow population that is far off no event gets away by itself, and it does not follow. So
    populations are fitted from a wide one, and what has more evidence is kept.
    """
    rows, points = likelihood.rows, [fit.points for fit, _ in found]
    lost = np.unique(rows.group[lost_rows(rows, likelihood.predict(np.concatenate(points)))])
    best = list(found)
    if not len(lost):
        return best
    part = likelihood.of_groups(lost)
    again = _round(part, _asked_for(part, [found[k][0] for k in lost]), budget, reference)
    for k, instead in zip(lost, again, strict=True):
        best[k] = max(best[k], instead, key=lambda one: one[0].found.log_evidence)
    return best


def _asked_for(likelihood: EventLikelihood, fits: Sequence[Fit]) -> list[Fit]:
    """The populations that events ask for, fitted from a wide one around each fit's.

    One by one: together they would go on until the last has settled, and depend on which others there are.
    """
    n = fits[0].points.shape[1] - 1
    wide = population_at(np.stack([fit.found.psi for fit in fits]), n)
    wide = wide._replace(covariance=wide.covariance + STARTING_SPREAD**2 * np.eye(n))
    prior = mean_prior(likelihood.extension.law)
    found = [
        fit_population(likelihood.of_groups(np.array([k])), prior, (one, fits[k].points))
        for k, one in enumerate(wide.groups)
    ]
    return [Fit(unfitted(population), points) for population, points in found]


def unfitted(population: Population) -> Evidence:
    """A population to begin with."""
    psi = coordinates(population)
    return Evidence(-np.inf, psi, np.eye(len(psi)))


def _moved(before: FloatArray, after: FloatArray, n: int) -> bool:
    """Whether a population is far from the one that its nodes were made for."""
    mean = np.abs(after[:n] - before[:n]) / np.exp(before[n : 2 * n])
    spread = np.abs(after[n : 2 * n] - before[n : 2 * n])
    return bool(max(mean.max(), spread.max()) > _FAR)
