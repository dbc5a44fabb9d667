"""Is anything wrong? A parametric bootstrap test of the evidence for anything at all.

The statistic is the log odds of anything against nothing. Whole campaigns are simulated from the base law's
posterior and everything is refitted to each, so that looking at many mechanisms and places is accounted for.
Those of simulated campaigns are computed by fronts (`by_fronts`), and so are those of the recordings where
that is enough: of a law with something added, of which nothing more is missing mostly. Sampling stops as soon
as the answer is clear (Besag and Clifford, 1991, doi 10.1093/biomet/78.2.301). Bayes factors of clean
campaigns average to one, so that odds of 100 to 1 are rarer than one in a hundred by Markov's inequality: a
few campaigns show there what is usual.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import logit

from skred.arrays import FloatArray
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.check.by_fronts import log_odds_by_fronts
from skred.diagnosis.clock import Progress
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, Rows
from skred.diagnosis.evidence.linear_mixed_model import Scores, fit_population
from skred.diagnosis.limits import FEWEST_CLEAN, LIMIT, NOTHING_AT_MOST, fewest_clean
from skred.parallel.processes import worker_pool

_ENOUGH_ABOVE = 4
"""Clean campaigns at least as odd after which sampling stops: p is known to half of itself then."""
_BATCH = 25
"""Campaigns refitted together: large enough for arrays, small enough to stop early."""
_LOOKS = 4
"""Looks at the recordings by fronts: what one of two finds is missed by all once in sixteen."""
_FEW = fewest_clean(NOTHING_AT_MOST)
"""Clean campaigns by fronts at most where nothing is too probable for a claim, or the odds are rare: they
show what is usual. Else as few as place the limit."""
_RARE = -math.log(LIMIT)
"""Log odds that at most so many of clean campaigns have, by Markov's inequality."""
_OF_A_CLAIM = -float(logit(NOTHING_AT_MOST))
"""Log odds above which nothing is not too probable for a claim."""


@dataclass(frozen=True, eq=False)
class BootstrapTest:
    """The check's outcome.

    Attributes
    ----------
    statistic : float
        Log odds of anything against nothing.
    simulated : (n,) array
        The same of clean campaigns.
    """

    statistic: float
    simulated: FloatArray

    @property
    def p_value(self) -> float:
        """Share of clean campaigns at least as odd, or a limit that it is not above.

        By Besag and Clifford's rule where it stopped early.
        """
        return LIMIT if self.is_bound else self._share

    @property
    def is_bound(self) -> bool:
        """Whether the p-value is a limit, by Markov's inequality: few were simulated, and none is as odd."""
        none = not (self.simulated >= self.statistic).any()
        return none and self.statistic >= _RARE and self._share > LIMIT

    @property
    def _share(self) -> float:
        above = int(np.sum(self.simulated >= self.statistic))
        if above >= _ENOUGH_ABOVE:
            return above / len(self.simulated)
        return (above + 1) / (len(self.simulated) + 1)

    @property
    def needed(self) -> float:
        """Log odds that would still raise an alarm: rare ones, or more than clean campaigns have."""
        beyond = _RARE if self.is_bound else float(self.simulated.max(initial=-math.inf))
        return max(beyond, _OF_A_CLAIM)

    @property
    def fired(self) -> bool:
        """Whether the calibrated limit is passed."""
        return self.p_value <= LIMIT


def odds_of_recordings(base: Base, seed: int) -> float:
    """Log odds of anything against nothing of the recordings, by fronts: the mean odds of some looks.

    Each look draws shapes anew; one alone may miss the place of what is there.
    """
    test = ScoreTest(base)
    own = _refitted(test, base.rows, base.fit.start).one(0)
    rngs = [np.random.default_rng([seed, 23, look]) for look in range(_LOOKS)]
    with worker_pool() as pool:
        # The leading one is computed again where it is more probable than nothing.
        found = list(pool.map(partial(log_odds_by_fronts, test, 0.0, *own), rngs))
    return float(np.logaddexp.reduce(found)) - math.log(_LOOKS)


def odds_test(
    base: Base,
    draws: tuple[FloatArray, FloatArray],
    seed: int,
    log_odds: float,
    progress: Progress = lambda done, of: None,
) -> BootstrapTest:
    """Check a law by the odds of the recordings.

    Parameters
    ----------
    base : Base
        Fitted to the recordings.
    draws : (n, n_base) and (n, n_base, n_base) arrays
        Means and factors of populations from the law's posterior.
    log_odds : float
        Of anything against nothing: a comparison's, or by fronts.
    progress : callable
        Is told how many clean campaigns are refitted, and of how many at most.
    """
    test, rng = ScoreTest(base), np.random.default_rng([seed, 21])
    most = FEWEST_CLEAN if _OF_A_CLAIM < log_odds < _RARE else _FEW
    reach = log_odds if log_odds > _OF_A_CLAIM else math.inf  # no claim hangs on the others
    simulated, above = list[float](), 0
    for first in range(0, most, _BATCH):
        clean = _simulated(test, draws, slice(first, min(first + _BATCH, most)), rng)
        for one in _by_fronts(test, _refitted(test, *clean), reach, seed, first):
            simulated.append(one)
            progress(len(simulated), most)
            above += one >= log_odds
            if above >= _ENOUGH_ABOVE:
                return BootstrapTest(log_odds, np.array(simulated))
    return BootstrapTest(log_odds, np.array(simulated))


def _by_fronts(test: ScoreTest, refitted: _Refitted, reach: float, seed: int, first: int) -> Iterator[float]:
    """Log odds of each campaign, numbered from the first one."""
    groups = range(refitted.rows.n_groups)
    rngs = [np.random.default_rng([seed, 22, first + group]) for group in groups]
    campaigns = zip(*map(refitted.one, groups), strict=True)
    with worker_pool() as pool:  # those that nobody waits for any more are not begun
        yield from pool.map(partial(log_odds_by_fronts, test, reach), *campaigns, rngs)


class _Refitted(NamedTuple):
    """Campaigns, one group each, refitted; what the linear model says of them."""

    rows: Rows
    population: Population
    points: FloatArray
    scores: Scores

    def one(self, group: int) -> tuple[Rows, tuple[Population, FloatArray], Scores]:
        """One of the campaigns by itself."""
        own, rows = self.rows.of_groups(np.array([group]))
        scores = Scores(*(values[group : group + 1] for values in self.scores))
        return rows, (self.population.groups[group], self.points[own]), scores


def _simulated(
    test: ScoreTest, draws: tuple[FloatArray, FloatArray], batch: slice, rng: np.random.Generator
) -> tuple[Rows, tuple[Population, FloatArray]]:
    """Clean campaigns from some of the draws, and where to begin refitting them."""
    means, factors = draws[0][batch], draws[1][batch]
    rows, points = bootstrap_campaigns(test.base.extended(), test.base.strengths, means, factors, rng)
    return rows, (Population(means.copy(), np.einsum("gij,gkj->gik", factors, factors)), points)


def _refitted(test: ScoreTest, rows: Rows, start: tuple[Population, FloatArray]) -> _Refitted:
    """Populations and events refitted."""
    likelihood = EventLikelihood(test.base.extended(), rows, test.base.strengths)
    population, points = fit_population(likelihood, test.prior, start)
    return _Refitted(rows, population, points, test.scores(rows, points, population))
