"""Climbs to the maximum of the posterior of a force that is not in the list, under one prior.

Gauss-Newton steps around the events' modes: score and information of the knots' values are efficient ones,
with what events and population take of them taken out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.explored import Expansion, prior_penalty
from skred.diagnosis.discrepancy.profile import Kind, combined, knot_by_knot
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, look_around
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, mean_prior
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.evidence.tolerance import ARRIVED, MOST_ROUNDS, STEP_SHARES


def expanded_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Expansion:
    """The log likelihood around some values of a profile, population and events refitted with them in.

    Parameters
    ----------
    at : (n_knots,) array
        Places of the knots [m].
    values : (n_free + n_knots,) array
        Strengths of the base's last directions, if some are free too, then the profile in the kind's unit.
    start : (Population, points)
        Where the refit begins.
    """
    return _around(base, kind, at, values, _fit_at(base, kind, at, values, start))


def climb(base: Base, kind: Kind, at: FloatArray, start: Expansion, cover: FloatArray) -> Expansion:
    """The maximum of the posterior under one prior.

    Parameters
    ----------
    at : (n_knots,) array
        Places of the knots [m].
    start : Expansion
        Around the values to begin from.
    cover : (n_free + n_knots, n_free + n_knots) array
        Covariance of the values under the prior.
    """
    maximum = start
    precision = np.linalg.inv(cover)
    for _ in range(MOST_ROUNDS):
        slope = maximum.score - precision @ maximum.values
        step = np.linalg.solve(maximum.information + precision, slope)
        height = maximum.fit.found.log_evidence - prior_penalty(maximum.values, precision)
        expected = 0.5 * float(step @ slope)
        for share in STEP_SHARES:
            if share * (2.0 - share) * expected < ARRIVED:
                return _arrived(maximum, precision)
            values = maximum.values + share * step
            fit = _fit_at(base, kind, at, values, maximum.fit.start)
            gained = fit.found.log_evidence - prior_penalty(values, precision) - height
            if gained > 0.0:
                break
        else:
            break
        maximum = _around(base, kind, at, values, fit)
        if gained < ARRIVED:
            break
    return _arrived(maximum, precision)


def _arrived(maximum: Expansion, precision: FloatArray) -> Expansion:
    """A maximum that was climbed to: a score that is left over, at kinks where fronts stop, leads nowhere."""
    return replace(maximum, score=precision @ maximum.values)


def _fit_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Fit:
    """Population and events with the profile in."""
    held, free = _held(base, at, values), len(values) - len(at)
    extension = base.extended(combined(base.setting, kind, at, values[free:]))
    strengths = np.concatenate([held, values[:free], [1.0]])[None, :]
    return refit(extension, base.rows, strengths, start, Rounds(least=1))[0]


def _held(base: Base, at: FloatArray, values: FloatArray) -> FloatArray:
    """Strengths of the base's directions that are not free."""
    return base.strengths[: len(base.strengths) - (len(values) - len(at))]


def _around(base: Base, kind: Kind, at: FloatArray, values: FloatArray, fit: Fit) -> Expansion:
    """With efficient score and information of the knots' values at what they are."""
    wide = knot_by_knot(base, kind, at)
    population, points = fit.start
    held = _held(base, at, values)
    around = look_around(EventLikelihood(wide, base.rows, np.concatenate([held, values])), points)
    found = efficient_scores(around, base.rows, population, mean_prior(base.law))
    n_before = len(held)
    return Expansion(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])
