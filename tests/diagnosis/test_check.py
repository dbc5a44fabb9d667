"""The odds of simulated campaigns: one shape of each mechanism stands for all."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, gates_campaign, sparse_base, trial

from skred.campaign import Status
from skred.diagnosis.check import bootstrap_test, by_fronts
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.check.bootstrap_test import odds_of_recordings, odds_test
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.detect.score_test import LinearFactors, ScoreTest
from skred.diagnosis.diagnose import diagnose
from skred.diagnosis.effort import SAMPLING, Effort
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.outcome import Diagnosis
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law


def test_one_shape_estimates_the_evidence_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """On average over the draws, whatever the linear model promises."""
    base = sparse_base()
    placed = [one for one in ScoreTest(base).placed_mechanisms][:4]
    true = dict(zip(map(id, (one.shape for one in placed)), (3.0, -1.0, 0.5, 2.0), strict=True))

    class Known:
        def __init__(self, shape: Any) -> None:
            self.log_bayes_factor = true[id(shape)]

    monkeypatch.setattr(by_fronts, "curve", lambda base, candidate: Known(candidate.shape))
    shares = np.array([0.1, 0.4, 0.3, 0.2])
    linear = LinearFactors(placed, np.array([[-2.0, 4.0, 0.0, 1.0]]), np.log(shares), -1.5)
    rng = np.random.default_rng(0)
    drawn = [by_fronts.drawn(base, linear, rng) for _ in range(4000)]
    weights = np.exp([one.log_bayes_factor + beside for one, beside in drawn])
    exact = np.exp(-1.5) * float(shares @ np.exp(list(true.values())))
    assert abs(weights.mean() - exact) < 4.0 * weights.std() / np.sqrt(len(weights))
    # No draw promises more than twice what its shape has at most.
    assert weights.max() <= 2.0 * np.exp(-1.5 + 3.0)


@pytest.mark.slow
def test_clean_campaigns_are_computed_again_where_a_claim_hangs_on_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base = sparse_base()
    n = len(base.law.mechanisms)
    draws = np.tile(base.population.mean, (120, 1)), np.tile(0.1 * np.eye(n), (120, 1, 1))
    quick, reached = bootstrap_test.log_odds_by_fronts, list[float]()

    def told(test: ScoreTest, reach: float, *given: Any) -> float:
        reached.append(reach)
        return quick(test, reach, *given) if len(reached) <= 3 else -1.0

    monkeypatch.setattr(bootstrap_test, "log_odds_by_fronts", told)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    progress = list[tuple[int, int]]()
    found = odds_test(base, draws, 5, -1.5, lambda *done: progress.append(done))
    assert progress == [(k, progress[0][1]) for k in range(1, len(found.simulated) + 1)]
    assert (found.simulated < 3.0).all()  # as Markov's inequality wants it
    assert set(reached) == {np.inf}
    reached.clear()
    placed = odds_test(base, draws, 5, 3.0)
    assert placed.fired and not placed.is_bound and len(placed.simulated) == 99 and set(reached) == {3.0}
    reached.clear()
    rare = odds_test(base, draws, 5, 6.0)
    assert rare.fired and rare.is_bound and len(rare.simulated) == 9 and set(reached) == {6.0}


@pytest.mark.parametrize(("above", "again"), [(-0.5, True), (0.5, True), (1.5, False)])
def test_what_is_just_below_the_recordings_is_computed_again_too(
    above: float, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or errors of the quick odds would only ever lower a campaign's, and p with them."""
    base = sparse_base()
    test, looked = ScoreTest(base), list[str]()

    def lower(base: Base, one: Any) -> tuple[Any, float]:
        looked.append(one.mechanism.id)
        return SimpleNamespace(log_bayes_factor=-9.0), 0.0

    monkeypatch.setattr(by_fronts, "computed_again", lower)
    scores = test.scores(base.rows, base.fit.points, base.fit.population)

    def odds(reach: float) -> float:
        rng = np.random.default_rng(2)
        return by_fronts.log_odds_by_fronts(test, reach, base.rows, base.fit.start, scores, rng)

    quick = odds(np.inf)
    assert not looked
    assert (odds(quick + above) < quick) == again == bool(looked)


def test_evidence_of_one_shape_is_that_of_a_comparison() -> None:
    base = sparse_base()
    test = ScoreTest(base)
    one = next(one for one in test.placed_mechanisms if one.mechanism.id == "viscous_drag")
    linear = LinearFactors([one], np.zeros((1, 1)), np.zeros(1), 0.0)
    fitted, beside = by_fronts.drawn(base, linear, np.random.default_rng(1))
    assert beside == pytest.approx(0.0)
    assert fitted.log_bayes_factor == curve(base, one).log_bayes_factor


def test_clean_campaigns_have_errors_where_readings_state_their_own() -> None:
    """A front of theirs may come to a sensor that the recorded one did not come to, with the usual error."""
    campaign = sparse_base().problem.campaign
    stated = np.where(campaign.status == Status.OBSERVED, np.where(campaign.values > 0.0, 1.5, 0.0), np.nan)
    stated = np.where(stated == 0.0, 0.7, stated)
    sensors = tuple(replace(one, relative_sd=0.0, absolute_sd=0.0) for one in campaign.sensors)
    base = base_of(replace(campaign, sensors=sensors, stated_sd=stated), "coulomb")
    assert (campaign.status == Status.NOT_REACHED).any()
    draws = np.tile(base.population.mean, (9, 1)), np.tile(0.3 * np.eye(1), (9, 1, 1))
    rows, _ = bootstrap_campaigns(base.extended(), base.strengths, *draws, np.random.default_rng(0))
    assert (rows.readings.observed & (rows.readings.stated_sd == 0.0)).any()
    assert (rows.readings.sd(np.arange(len(rows.event)), rows.readings.values) > 0.0).all()
    assert np.isfinite(odds_test(base, draws, 5, 6.0).simulated).all()


def test_odds_of_the_recordings_by_fronts() -> None:
    """A gate that reads too high is more probable than nothing; in clean recordings nothing is."""
    clean, biased = (base_of(gates_campaign(range(8), biased=which), "constant") for which in (False, True))
    assert odds_of_recordings(clean, 1) < 0.0 < 5.0 < odds_of_recordings(biased, 1)


@pytest.mark.slow
@pytest.mark.timeout(1800)  # a whole diagnosis with two mechanisms: nine minutes alone
def test_a_second_effect_is_not_lost_among_what_tangents_overstate() -> None:
    """The linear model had odds of e^6 for the recordings, and clean campaigns of its own had more."""
    campaign = trial(41001, "sparse", "two", "pcm", 10.0).campaign
    found = diagnose(hierarchical_problem(campaign), load_law("pcm"), SAMPLING, Effort())
    assert isinstance(found, Diagnosis) and len(found.steps) == 2
    assert found.steps[1].candidate.mechanism.id == "covariate_friction"
    assert found.steps[0].check.fired and not found.steps[1].check.fired
