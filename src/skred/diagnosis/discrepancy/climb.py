"""Climbs to the maximum of the posterior of many values together, as of a force that is not in the list.

By Gauss-Newton steps under one prior. Score and information of the values at the events' modes are efficient,
with what events and population take of them taken out. Where fronts may have stopped or gone on, the evidence
can rise another way. Its own score is by quadrature: it costs more, and is noisy where fronts are about to
stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.explored import Expansion, prior_penalty
from skred.diagnosis.discrepancy.profile import Kind
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, look_around
from skred.diagnosis.evidence.expected_score import expected_score
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, mean_prior
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.evidence.stated_places import StatedPlaces
from skred.diagnosis.evidence.tolerance import ARRIVED, MOST_ROUNDS, STEP_SHARES

Values = Kind | StatedPlaces
"""Values that are fitted together beside a law: what they are the strengths of."""


def expanded_at(
    base: Base, kind: Values, values: FloatArray, start: tuple[Population, FloatArray]
) -> Expansion:
    """The log likelihood around some values, population and events refitted with them in.

    Parameters
    ----------
    kind : Values
        Such as a kind of profile, with a value at each knot.
    values : (n_free + n_values,) array
        Strengths of the base's last directions, if some are free too, then the values.
    start : (Population, points)
        Where the refit begins.
    """
    return _around(base, kind, values, _fit_at(base, kind, values, start))


def climb(
    base: Base, kind: Values, start: Expansion, cover: FloatArray, *, by_modes: bool = True
) -> Expansion:
    """The maximum of the posterior under one prior.

    Parameters
    ----------
    start : Expansion
        Around the values to begin from.
    cover : (n_free + n_values, n_free + n_values) array
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
                return arrived(maximum, precision)
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
    return arrived(maximum, precision)


def highest(maxima: Sequence[Expansion], cover: FloatArray) -> Expansion:
    """The one with the highest posterior under a prior."""
    precision = np.linalg.inv(cover)
    return max(maxima, key=lambda one: one.fit.found.log_evidence - prior_penalty(one.values, precision))


def arrived(maximum: Expansion, precision: FloatArray) -> Expansion:
    """A maximum that was climbed to: a score that is left over, at kinks where fronts stop, leads nowhere."""
    return replace(maximum, score=precision @ maximum.values)


def _fit_at(base: Base, kind: Values, values: FloatArray, start: tuple[Population, FloatArray]) -> Fit:
    """Population and events with the values in."""
    extension, strengths = _with_values(base, kind, values)
    return refit(extension, base.rows, strengths[None, :], start, Rounds(least=1))[0]


def _with_values(base: Base, kind: Values, values: FloatArray) -> tuple[Extension, FloatArray]:
    """The base law with the values in, and all strengths, (n_directions,)."""
    free = len(values) - len(kind.each(base.setting))
    directions, together = kind.together(base.setting, values[free:])
    return base.extended(*directions), np.concatenate([_held(base, free), values[:free], together])


def _held(base: Base, free: int) -> FloatArray:
    """Strengths of the base's directions that are not free."""
    return base.strengths[: len(base.strengths) - free]


def _around(base: Base, kind: Values, values: FloatArray, fit: Fit) -> Expansion:
    """With efficient score and information of the values at what they are."""
    population, points = fit.start
    likelihood, n_before = _one_by_one(base, kind, values)
    found = efficient_scores(look_around(likelihood, points), base.rows, population, mean_prior(base.law))
    return Expansion(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])


def _score(base: Base, kind: Values, there: Expansion) -> FloatArray:
    """Score of the log evidence by the values."""
    extension, strengths = _with_values(base, kind, there.values)
    likelihood = EventLikelihood(extension, base.rows, strengths)
    each, n_before = _one_by_one(base, kind, there.values)
    return expected_score(likelihood, each, *there.fit.start)[n_before:]


def _one_by_one(base: Base, kind: Values, values: FloatArray) -> tuple[EventLikelihood, int]:
    """The events' likelihoods with each value as a strength, and how many strengths are before them."""
    each = kind.each(base.setting)
    held = _held(base, len(values) - len(each))
    return EventLikelihood(base.extended(*each), base.rows, np.concatenate([held, values])), len(held)
