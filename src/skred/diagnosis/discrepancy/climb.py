"""Climbs to the maximum of the posterior of a force that is not in the list, under one prior.

By Gauss-Newton steps. Score and information of the knots' values at the events' modes are efficient ones,
with what events and population take of them taken out. Where fronts may have stopped or gone on, the evidence
can rise another way. Its own score is by quadrature: it costs more, and is noisy where fronts are about to
stop.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.explored import Expansion, prior_penalty
from skred.diagnosis.discrepancy.profile import Kind, combined, knot_by_knot, knots
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, look_around
from skred.diagnosis.evidence.expected_score import expected_score
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, mean_prior
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.evidence.tolerance import ARRIVED, MOST_ROUNDS, STEP_SHARES


def expanded_at(
    base: Base, kind: Kind, values: FloatArray, start: tuple[Population, FloatArray]
) -> Expansion:
    """The log likelihood around some values of a profile, population and events refitted with them in.

    Parameters
    ----------
    values : (n_free + n_knots,) array
        Strengths of the base's last directions, if some are free too, then the profile in the kind's unit.
    start : (Population, points)
        Where the refit begins.
    """
    return _around(base, kind, values, _fit_at(base, kind, values, start))


def climb(base: Base, kind: Kind, start: Expansion, cover: FloatArray, *, by_modes: bool = True) -> Expansion:
    """The maximum of the posterior under one prior.

    Parameters
    ----------
    start : Expansion
        Around the values to begin from.
    cover : (n_free + n_knots, n_free + n_knots) array
        Covariance of the values under the prior.
    by_modes : bool
        Whether steps follow the score at the events' modes; else that of the evidence itself, no farther than
        the prior's standard deviations.
    """
    maximum = start
    precision = np.linalg.inv(cover)
    for _ in range(MOST_ROUNDS):
        score = maximum.score if by_modes else _score(base, kind, maximum)
        slope, curvature = score - precision @ maximum.values, maximum.information + precision
        step = np.linalg.solve(curvature, slope)
        if not by_modes:  # tangents of fronts that are about to stop hold over very short steps only
            step /= max(float(np.abs(step / np.sqrt(np.diag(cover))).max()), 1.0)
        height = maximum.fit.found.log_evidence - prior_penalty(maximum.values, precision)
        rise, bend = float(step @ slope), float(step @ curvature @ step)
        for share in STEP_SHARES:
            if share * rise - 0.5 * share**2 * bend < ARRIVED:
                return _arrived(maximum, precision)
            values, gained = maximum.values + share * step, -math.inf
            # A step can lead to what no front can do, as a drag far below nil.
            with suppress(np.linalg.LinAlgError):
                fit = _fit_at(base, kind, values, maximum.fit.start)
                gained = fit.found.log_evidence - prior_penalty(values, precision) - height
            if gained > 0.0:
                break
        else:
            break
        maximum = _around(base, kind, values, fit)
        if gained < ARRIVED:
            break
    return _arrived(maximum, precision)


def _arrived(maximum: Expansion, precision: FloatArray) -> Expansion:
    """A maximum that was climbed to: a score that is left over, at kinks where fronts stop, leads nowhere."""
    return replace(maximum, score=precision @ maximum.values)


def _fit_at(base: Base, kind: Kind, values: FloatArray, start: tuple[Population, FloatArray]) -> Fit:
    """Population and events with the profile in."""
    extension, strengths = _with_profile(base, kind, values)
    return refit(extension, base.rows, strengths[None, :], start, Rounds(least=1))[0]


def _with_profile(base: Base, kind: Kind, values: FloatArray) -> tuple[Extension, FloatArray]:
    """The base law with the profile as one direction, and all strengths, (n_directions,)."""
    at, held = knots(base.setting), _held(base, values)
    free = len(values) - len(at)
    extension = base.extended(combined(base.setting, kind, at, values[free:]))
    return extension, np.concatenate([held, values[:free], [1.0]])


def _held(base: Base, values: FloatArray) -> FloatArray:
    """Strengths of the base's directions that are not free."""
    return base.strengths[: len(base.strengths) - (len(values) - len(knots(base.setting)))]


def _around(base: Base, kind: Kind, values: FloatArray, fit: Fit) -> Expansion:
    """With efficient score and information of the knots' values at what they are."""
    population, points = fit.start
    by_knots = _by_knots(base, kind, values)
    found = efficient_scores(look_around(by_knots, points), base.rows, population, mean_prior(base.law))
    n_before = len(_held(base, values))
    return Expansion(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])


def _score(base: Base, kind: Kind, there: Expansion) -> FloatArray:
    """Score of the log evidence by the values."""
    extension, strengths = _with_profile(base, kind, there.values)
    likelihood = EventLikelihood(extension, base.rows, strengths)
    score = expected_score(likelihood, _by_knots(base, kind, there.values), *there.fit.start)
    return score[len(_held(base, there.values)) :]


def _by_knots(base: Base, kind: Kind, values: FloatArray) -> EventLikelihood:
    """The events' likelihoods with the value at each knot as a strength."""
    strengths = np.concatenate([_held(base, values), values])
    return EventLikelihood(knot_by_knot(base, kind, knots(base.setting)), base.rows, strengths)
