"""A quick hierarchical fit of the base law, which several baselines start from: no sampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    Rows,
    campaign_rows,
    event_modes,
)
from skred.diagnosis.evidence.extension import extended, setting_of
from skred.diagnosis.evidence.linear_mixed_model import (
    Scores,
    fit_population,
    mean_prior,
    starting_population,
)
from skred.diagnosis.evidence.refit import Fit, unfitted
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Shape

from .common import Stretch
from .profiles import starting_coefficients

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class QuickFit:
    """The base law fitted, around the events' modes.

    Attributes
    ----------
    problem : HierarchicalProblem
    law : Law
    score_test : ScoreTest
        All that could be missing.
    rows : Rows
    population : Population
    modes : Modes
    """

    problem: HierarchicalProblem
    law: Law
    score_test: ScoreTest
    rows: Rows
    population: Population
    modes: Modes

    @property
    def scores(self) -> Scores:
        """Efficient scores of all that could be missing."""
        return self.score_test.scores(self.rows, self.modes.points, self.population)


def quick_fit(campaign: Campaign, base_law: str) -> QuickFit:
    """Fit the base law by expectation-maximisation around the events' modes."""
    problem, law = hierarchical_problem(campaign), load_law(base_law)
    extension = extended(problem, law)
    rows = campaign_rows(extension)
    likelihood = EventLikelihood(extension, rows, np.zeros(0))
    points = np.zeros((campaign.n_events, len(law.mechanisms) + 1))
    points[:, :-1] = np.log(starting_coefficients(problem, law, own=True))
    # Each event near its own readings: from a common start some stay where their front stops too early.
    start = Population(np.median(points[:, :-1], axis=0)[None], starting_population(law).covariance)
    population, points = fit_population(likelihood, mean_prior(law), (start, points))
    modes = event_modes(likelihood, points, population)
    base = Base(problem, law, setting_of(problem, law), rows, Fit(unfitted(population), modes.points))
    return QuickFit(problem, law, ScoreTest(base), rows, population, modes)


def stretch_of(shape: Shape) -> Stretch | None:
    """From and to of a shape, where it is local."""
    if shape.s_from_m is None or shape.s_to_m is None:
        return None
    return shape.s_from_m, shape.s_to_m
