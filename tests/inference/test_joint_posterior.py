"""Posteriors of the integrated model against a sampler of the joint one, which integrates nothing."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
import pymc as pm
import pytest

from skred.campaign import find_campaign, read_campaign
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.joint_metropolis import JointMetropolis
from skred.physics.law import Law
from skred.physics.laws import load_law

SIX = ["19840302", "19870128", "19890403", "19940318", "20000217", "20050416"]
LIMIT = 4.0
"""Of a difference, in its standard errors."""


@pytest.fixture(scope="module")
def gibbs() -> Any:
    return importlib.import_module("benchmarks.peers.joint_gibbs")


def problem_of(ids: list[str], errors: str = "robust") -> HierarchicalProblem:
    campaign = read_campaign(find_campaign("ryggfonn"))
    rows = [campaign.event_ids.index(name) for name in ids]
    return hierarchical_problem(
        replace(
            campaign,
            events=tuple(campaign.events[row] for row in rows),
            values=campaign.values[rows],
            status=campaign.status[rows],
            stated_sd=campaign.stated_sd[rows],
        ),
        error_model=errors,
    )


def moments(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the parameters, and their errors from how the chains differ."""
    centre = draws.mean(axis=(0, 1))
    of_chains = np.concatenate([draws.mean(axis=1), ((draws - centre) ** 2).mean(axis=1)], axis=1)
    value, error = of_chains.mean(axis=0), of_chains.std(axis=0, ddof=1) / np.sqrt(len(draws))
    n = len(centre)
    sd = np.sqrt(value[n:])
    return np.append(value[:n], sd), np.append(error[:n], error[n:] / (2 * sd))


def integrated(gibbs: Any, problem: HierarchicalProblem, law: Law, draws: int) -> np.ndarray:
    """Draws of the integrated model by JointMetropolis, on the scale of the other sampler."""
    model = law.build(problem)
    with model:
        tree = pm.sample(
            draws,
            tune=1000,
            chains=12,
            cores=1,
            step=JointMetropolis(model=model),
            random_seed=2,
            progressbar=False,
            compute_convergence_checks=False,
        )
    return np.asarray(gibbs.parameter_rows(law, tree["posterior"]))


def z_scores(
    gibbs: Any, problem: HierarchicalProblem, law_id: str, *, chains: int, sweeps: int, draws: int
) -> np.ndarray:
    """Differences of means, then of standard deviations, in their standard errors."""
    law = load_law(law_id)
    joint = gibbs.JointGibbs(problem, law, chains, seed=1).run(sweeps, sweeps // 2)
    (one, one_error), (two, two_error) = (
        moments(part) for part in (joint, integrated(gibbs, problem, law, draws))
    )
    n = len(one) // 2
    assert np.all(one_error < 0.1 * np.tile(one[n:], 2)), "the joint sampler has not mixed"
    return np.asarray((one - two) / np.hypot(one_error, two_error))


@pytest.mark.slow
@pytest.mark.parametrize("law_id", ["constant", "coulomb"])
def test_laws_of_one_strength(gibbs: Any, law_id: str) -> None:
    scores = z_scores(gibbs, problem_of(SIX), law_id, chains=32, sweeps=600, draws=1000)
    assert np.abs(scores).max() < LIMIT, scores


@pytest.mark.slow
@pytest.mark.parametrize("errors", ["robust", "student"])
def test_a_law_of_two_strengths(gibbs: Any, errors: str) -> None:
    scores = z_scores(gibbs, problem_of(SIX, errors), "pcm", chains=64, sweeps=5000, draws=3000)
    assert np.abs(scores).max() < LIMIT, scores


@pytest.mark.slow
def test_slow_avalanches_that_need_a_drag_far_above_its_prior_scale(gibbs: Any) -> None:
    """A search that ends too early shows here: in the medians and spreads of the drag."""
    slow = ["19840302", "19880315", "19920311", "19940318", "20000217", "20030406"]
    scores = z_scores(gibbs, problem_of(slow, "normal"), "pcm", chains=64, sweeps=4000, draws=3000)
    assert np.abs(scores).max() < LIMIT, scores


@pytest.mark.slow
def test_a_wrong_integral_would_be_found(gibbs: Any) -> None:
    """An event that counts twice, and one not at all: the comparison must see as much."""
    law = load_law("constant")
    other = problem_of([*SIX[:4], SIX[0], SIX[5]])
    joint = gibbs.JointGibbs(problem_of(SIX), law, 32, seed=1).run(600, 300)
    (one, one_error), (two, two_error) = moments(joint), moments(integrated(gibbs, other, law, 1000))
    assert np.abs((one - two) / np.hypot(one_error, two_error)).max() > 2 * LIMIT


def test_the_joint_sampler_on_a_population_alone(gibbs: Any) -> None:
    """Without any likelihood the chains must give the prior: 0.13 and a log standard deviation of 0.6."""
    chains = gibbs.JointGibbs(problem_of(SIX[:2]), load_law("pcm"), 64, seed=3)
    chains.log_likelihood = lambda x: np.zeros(x.shape[:2])
    chains.log_l = np.zeros_like(chains.log_l)
    value, error = moments(chains.run(1500, 500))
    expected_mean = [np.log(0.13), np.log(0.13), 0.0]
    expected_sd = [0.6, 0.6, np.sqrt(0.2)]
    assert np.all(np.abs(value[2:5] - expected_mean) < LIMIT * error[2:5])
    assert np.all(np.abs(value[7:] - expected_sd) < LIMIT * error[7:])
    # E log|N(0, 1)| is -(gamma + log 2) / 2.
    means = np.log([0.5, 0.01]) - 0.5 * (np.euler_gamma + np.log(2.0))
    assert np.all(np.abs(value[:2] - means) < LIMIT * error[:2])
