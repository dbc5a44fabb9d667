"""The odds of a simulated campaign by its fronts, where the linear model says that they are high.

Where fronts stop near sensors, tangents promise evidence that is not there. What the odds of a simulated
campaign mostly come from is then computed as a comparison does it: one candidate after the other, until the
odds have fallen below those that they are to be compared with, or have held.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.compare.screening import curve
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import Population, Rows
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import Scores
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.evidence.refit import Rounds, refit

FloatArray = NDArray[np.float64]
_COUNTS = 0.1
"""Share of the odds from which a candidate is computed by fronts: with less it hardly changes them."""


def log_odds_by_fronts(
    base: Base,
    score_test: ScoreTest,
    rows: Rows,
    start: tuple[Population, FloatArray],
    scores: Scores,
    reach: float,
) -> float:
    """Log odds of anything against nothing of one simulated campaign.

    Parameters
    ----------
    base : Base
        The law that it was simulated from.
    rows : Rows
        The campaign's, of one group.
    start : (Population, (n_events, n_base + 1) array)
        Fitted to it.
    scores : Scores
        Of one group.
    reach : float
        The odds to compare with: nothing more is computed once these are lower.
    """
    terms = {name: float(values[0]) for name, values in score_test.log_terms(scores).items()}
    simulated, todo = None, set(terms)
    while True:
        log_odds = float(np.logaddexp.reduce(list(terms.values())))
        counting = {name for name in todo if terms[name] >= log_odds + math.log(_COUNTS)}
        if log_odds < reach or not counting:
            return log_odds
        # The force not in the list last: its fit takes as long as those of all others.
        first = max(counting - {UNLISTED} or counting, key=lambda name: terms[name])
        simulated = _fitted(base, rows, start) if simulated is None else simulated
        terms[first] += _beyond_linear(simulated, score_test, scores, first)
        todo.remove(first)


def _fitted(base: Base, rows: Rows, start: tuple[Population, FloatArray]) -> Base:
    """The law fitted to a simulated campaign."""
    extension = extended(base.problem, base.law, base.directions)
    fit = refit(extension, rows, base.strengths[None, :], start, Rounds(USUAL))[0]
    return replace(base, rows=rows, fit=fit)


def _beyond_linear(base: Base, score_test: ScoreTest, scores: Scores, name: str) -> float:
    """What fronts change of a candidate's log Bayes factor in the linear model, at its best shape."""
    if name == UNLISTED:
        factors = score_test.log_factors_of_kinds(scores)[:, 0]
        kind = int(np.argmax(factors + np.log([one.share for one in KINDS])))
        return fit_profile(base, KINDS[kind]).log_bayes_factor - float(factors[kind])
    factors = score_test.log_factors(scores)[0]
    own = [k for k, one in enumerate(score_test.placed_mechanisms) if one.mechanism.id == name]
    best = max(own, key=lambda k: factors[k])
    placed = score_test.placed_mechanisms[best]
    return curve(base, placed.mechanism, placed.shape).log_bayes_factor - float(factors[best])
