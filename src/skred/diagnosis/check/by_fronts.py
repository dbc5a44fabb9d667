"""The odds of a simulated campaign by its fronts.

A comparison refits every mechanism in every shape, which is too slow for a hundred campaigns. Here each is
refitted in one of its shapes, drawn by what the linear model thinks of them and by their prior, half each.
With the weight of importance sampling this estimates the evidence over all shapes without bias, wherever the
linear model errs: tangents overstate it where fronts stop near sensors, and miss it where strengths have to
be large. What leads where the odds come close to those of the recordings, or above them, is computed again by
more points, as a comparison does.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.recomputed import computed_again
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.detect.score_test import LinearFactors, ScoreTest
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Kind, Profile
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import Population, Rows
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.linear_mixed_model import Scores
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING


def log_odds_by_fronts(
    score_test: ScoreTest,
    reach: float,
    rows: Rows,
    start: tuple[Population, FloatArray],
    scores: Scores,
    rng: np.random.Generator,
) -> float:
    """Log odds of anything against nothing of one simulated campaign.

    Parameters
    ----------
    score_test : ScoreTest
        Of the law that it was simulated from.
    reach : float
        The odds to compare with.
    rows : Rows
        The campaign's, of one group.
    start : (Population, (n_events, n_base + 1) array)
        Fitted to it.
    scores : Scores
        Of one group.
    """
    base = score_test.base
    fit = refit(base.extended(), rows, base.strengths[None, :], start, Rounds(USUAL))[0]
    simulated = replace(base, rows=rows, fit=fit)
    of_id = {name: drawn(simulated, one, rng) for name, one in score_test.by_id(scores).items()}
    terms = {name: beside + one.log_bayes_factor for name, (one, beside) in of_id.items()}
    while True:
        log_odds = float(np.logaddexp.reduce(list(terms.values())))
        first = max(terms, key=lambda name: terms[name])
        one, beside = of_id.pop(first, (None, 0.0))
        if log_odds < reach - DECIDES_NOTHING or not isinstance(one, Curve):
            return log_odds
        terms[first] = beside + computed_again(simulated, one)[0].log_bayes_factor


def drawn(base: Base, linear: LinearFactors, rng: np.random.Generator) -> tuple[Curve | Profile, float]:
    """One of the candidates that an id stands for, fitted; and what to add to its log Bayes factor."""
    log_prior = linear.log_shares - np.logaddexp.reduce(linear.log_shares)
    log_posterior = log_prior + linear.log_factors[0]
    log_posterior -= np.logaddexp.reduce(log_posterior)
    log_chance = np.logaddexp(log_prior, log_posterior) - math.log(2.0)
    k = int(rng.choice(len(log_chance), p=np.exp(log_chance)))
    candidate = linear.candidates[k]
    fitted = fit_profile(base, candidate) if isinstance(candidate, Kind) else curve(base, candidate)
    return fitted, linear.log_odds + float(log_prior[k] - log_chance[k])
