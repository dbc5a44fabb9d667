"""Is anything wrong? A parametric bootstrap test of the evidence for anything at all.

The statistic is the log odds of anything against nothing. Whole campaigns are simulated from the base law's
posterior and everything is refitted to each, so that looking at many mechanisms and places is accounted for.
Of simulated campaigns the odds are those of the linear model; where these reach the recordings', they are
computed by fronts (`by_fronts`). Sampling stops as soon as the answer is clear (Besag and Clifford, 1991, doi
10.1093/biomet/78.2.301).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import batched
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.check.by_fronts import log_odds_by_fronts
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, Rows
from skred.diagnosis.evidence.linear_mixed_model import Scores, fit_population
from skred.parallel.threads import side_by_side, threads

FloatArray = NDArray[np.float64]
LIMIT = 0.01
"""Share of clean campaigns that may be called wrong: the one limit of an alarm."""
_ENOUGH_ABOVE = 6
"""Clean campaigns at least as odd after which sampling stops: with so many of 500 there is no alarm."""
_BATCH = 25
"""Campaigns refitted together: large enough for arrays, small enough to stop early."""


@dataclass(frozen=True, eq=False)
class BootstrapTest:
    """The check's outcome.

    Attributes
    ----------
    statistic : float
        Log odds of anything against nothing: by the whole comparison, or in the linear model.
    simulated : (n,) array
        The same of clean campaigns, in the linear model; by fronts where that reaches the statistic.
    linear : float or None
        Of the recordings in the linear model, where the statistic is not that.
    simulated_linear : (n,) array, optional
        Of clean campaigns in the linear model, where `simulated` is not that.
    """

    statistic: float
    simulated: FloatArray
    linear: float | None = None
    simulated_linear: FloatArray | None = None

    @property
    def p_value(self) -> float:
        """Share of clean campaigns at least as odd, by Besag and Clifford's rule where it stopped early."""
        return _share(self.simulated, self.statistic)

    @property
    def fired(self) -> bool:
        """Whether the calibrated limit is passed."""
        return self.p_value <= LIMIT

    @property
    def p_value_in_linear_model(self) -> float:
        """The same of the recordings in the linear model."""
        if self.linear is None:
            return self.p_value
        return _share(self.simulated if self.simulated_linear is None else self.simulated_linear, self.linear)


def _share(simulated: FloatArray, statistic: float) -> float:
    """Of clean campaigns at least as odd."""
    above = int(np.sum(simulated >= statistic))
    if above >= _ENOUGH_ABOVE:
        return above / len(simulated)
    return (above + 1) / (len(simulated) + 1)


def bootstrap_test(
    base: Base,
    draws: tuple[FloatArray, FloatArray],
    seed: int,
    most: int = 300,
    log_odds: float | None = None,
) -> BootstrapTest:
    """Check a law, perhaps with mechanisms added.

    Parameters
    ----------
    base : Base
        Fitted to the recordings.
    draws : (n, n_base) and (n, n_base, n_base) arrays
        Means and factors of populations from the law's posterior, at least `most` of them.
    log_odds : float, optional
        Of anything against nothing, as a comparison has them; in the linear model unless given, and then of
        simulated campaigns as well.
    """
    test = ScoreTest(base.problem, base.law, base.setting, base.directions, base.strengths)
    linear = float(_refitted(test, base.rows, (base.population, base.fit.points)).log_odds[0])
    statistic = linear if log_odds is None else log_odds
    # At less than even odds there is no alarm, whatever clean campaigns have.
    by_fronts = log_odds is not None and log_odds > 0.0
    rng = np.random.default_rng([seed, 21])
    in_linear, simulated = list[FloatArray](), list[FloatArray]()
    for some in batched(range(0, most, _BATCH), threads()):
        # Simulated one after the other and counted in order: how many threads there are changes nothing.
        made = [_simulated(test, draws, slice(first, min(first + _BATCH, most)), rng) for first in some]
        for refitted in side_by_side(lambda clean: _refitted(test, *clean), made):
            in_linear.append(refitted.log_odds)
            found = refitted.log_odds.copy()
            if by_fronts:
                high = np.flatnonzero(found >= statistic)
                parts = [refitted.one(int(group)) for group in high]
                found[high] = side_by_side(lambda one: log_odds_by_fronts(base, test, *one, statistic), parts)
            simulated.append(found)
            done = BootstrapTest(statistic, np.concatenate(simulated), linear, np.concatenate(in_linear))
            if np.sum(done.simulated >= statistic) >= _ENOUGH_ABOVE:
                return done
    return done


class _Refitted(NamedTuple):
    """Simulated campaigns, one group each, refitted; what the linear model says of them."""

    rows: Rows
    population: Population
    points: FloatArray
    scores: Scores
    log_odds: FloatArray

    def one(self, group: int) -> tuple[Rows, tuple[Population, FloatArray], Scores]:
        """One of the campaigns by itself."""
        own = np.flatnonzero(self.rows.group == group)
        rows = self.rows.take(own)._replace(group=np.zeros(len(own), dtype=np.int64))
        scores = Scores(*(values[group : group + 1] for values in self.scores))
        return rows, (self.population.groups[group], self.points[own]), scores


def _simulated(
    test: ScoreTest, draws: tuple[FloatArray, FloatArray], batch: slice, rng: np.random.Generator
) -> tuple[Rows, tuple[Population, FloatArray]]:
    """Clean campaigns from some of the draws, and where to begin refitting them."""
    means, factors = draws[0][batch], draws[1][batch]
    rows, points = bootstrap_campaigns(test.extension, test.strengths, means, factors, rng)
    return rows, (Population(means.copy(), np.einsum("gij,gkj->gik", factors, factors)), points)


def _refitted(test: ScoreTest, rows: Rows, start: tuple[Population, FloatArray]) -> _Refitted:
    """Populations and events refitted."""
    likelihood = EventLikelihood(test.extension, rows, test.strengths)
    population, points = fit_population(likelihood, test.prior, start)
    scores = test.scores(rows, points, population)
    return _Refitted(rows, population, points, scores, test.statistic(scores))
