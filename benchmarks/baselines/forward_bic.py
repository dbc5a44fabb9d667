"""Forward selection by BIC with event effects: penalised least squares, every candidate mechanism refitted.

Each event's log base strengths have a normal population, estimated anew with each candidate, and a normal
release; given a strength, events are fitted by Gauss and Newton's method and integrated out by Laplace's
formula, as in nonlinear mixed-effects regression (Lindstrom and Bates, 1990, doi 10.2307/2532087). The
strength is maximised over a grid. BIC pays for strength and place: Schwarz (1978), doi
10.1214/aos/1176344136. Only the first step is taken: later ones change neither the alarm nor the first name.
Of a mechanism with many places those that lower the linearised criterion most are refitted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, log_joint, look_around
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import MeanPrior, fit_population, mean_prior
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN
from skred.physics.mechanisms.placed import PlacedMechanism

from .common import Answer, Stretch, is_dense, weighed
from .quick_fit import QuickFit, quick_fit, stretch_of

FloatArray = NDArray[np.float64]
# Tuned on development trials, seeds 5000-5029 and 5100-5159; see `common`.
LIMITS = {"sparse": -1.0, "dense": -1.5}
TEMPERATURE = 1.0
_PLACES = 2
"""Places of a mechanism that are refitted."""
_GRID = (0.25, 0.7, 1.4, 2.6)
"""Strengths tried, in scales of the mechanism; and once around the best. Of the time when a prior had one
scale, as the limits are that were tuned: a baseline stays what it was."""
_ROUNDS = 8


def heights(fit: QuickFit, candidate: PlacedMechanism | None, strengths: FloatArray) -> FloatArray:
    """Penalised log likelihood at some strengths of a candidate, all else refitted, (n,)."""
    directions = () if candidate is None else (candidate.direction,)
    extension, n = extended(fit.problem, fit.law, directions), len(strengths)
    likelihood = EventLikelihood(extension, fit.rows, np.empty(0))
    likelihood = likelihood.in_groups(strengths[:, None][:, : len(directions)])
    rows = likelihood.rows
    start = Population(*(np.repeat(part, n, axis=0) for part in fit.population))
    prior = mean_prior(fit.law)
    population, points = fit_population(
        likelihood, prior, (start, np.tile(fit.modes.points, (n, 1))), n_rounds=_ROUNDS
    )
    modes = look_around(likelihood, points)
    precision = population.precision
    height = log_joint(likelihood, points, population)
    height += 0.5 * np.linalg.slogdet(precision)[1][rows.group]
    height -= 0.5 * np.linalg.slogdet(modes.information + precision[rows.group])[1]
    total: FloatArray = height.reshape(n, -1).sum(axis=1) + _log_prior(population, prior)
    return total


def _log_prior(population: Population, prior: MeanPrior) -> FloatArray:
    """Of means and spreads, (n_groups,)."""
    z_mean = (population.mean - prior.mean) / prior.sd
    log_spread = 0.5 * np.log(np.einsum("gii->gi", population.covariance))
    z_spread = (log_spread - np.log(SPREAD_MEDIAN)) / SPREAD_LOG_SD
    return np.asarray(-0.5 * np.sum(z_mean**2 + z_spread**2, axis=1))


def gain(fit: QuickFit, candidate: PlacedMechanism) -> float:
    """How much a candidate raises the penalised log likelihood at its best strength."""
    added = candidate.added
    grid = added.scale * np.array(_GRID)
    strengths = np.concatenate([[0.0], grid, -grid]) if added.either_sign else np.append(0.0, grid)
    strengths = np.sort(strengths)
    found = heights(fit, candidate, strengths)
    top = int(np.argmax(found))
    around = strengths[max(top - 1, 0) : top + 2]
    finer = np.concatenate([0.5 * (around[1:] + around[:-1]), 0.25 * around[:1] + 0.75 * strengths[top]])
    best = max(float(found.max()), float(heights(fit, candidate, finer).max()))
    return best - float(found[strengths == 0.0][0])


def free_numbers(candidate: PlacedMechanism) -> int:
    """Numbers that a candidate has chosen: its strength and what says where."""
    shape = candidate.shape
    if shape.s_to_m is not None:
        return 3 if candidate.mechanism.id != "obstacle" else 2
    one_of_several = shape.sensor, shape.covariate, shape.s_from_m, *shape.constants
    return 1 if all(what is None for what in one_of_several) else 2


class ForwardBic:
    """The candidate that lowers BIC most."""

    id = "forward_bic"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Refit every candidate and compare BIC."""
        fit = quick_fit(campaign, base_law)
        todo = [one for one in fit.score_test.placed_mechanisms if not one.mechanism.same_term_as]
        linear = dict(
            zip(
                map(id, fit.score_test.placed_mechanisms),
                fit.score_test.log_factors(fit.scores)[0],
                strict=True,
            )
        )
        n_readings = int(fit.problem.observed.sum())
        factors: dict[str, float] = {}
        stretches: dict[str, Stretch | None] = {}
        for name in dict.fromkeys(one.mechanism.id for one in todo):
            own = sorted((one for one in todo if one.mechanism.id == name), key=lambda one: -linear[id(one)])
            for one in own[:_PLACES]:
                # Half the difference of BIC.
                value = gain(fit, one) - 0.5 * free_numbers(one) * np.log(n_readings)
                if value > factors.get(name, -np.inf):
                    factors[name], stretches[name] = float(value), stretch_of(one.shape)
        limit = LIMITS["dense" if is_dense(campaign) else "sparse"]
        return weighed(factors, base_law, limit, TEMPERATURE, stretches)
