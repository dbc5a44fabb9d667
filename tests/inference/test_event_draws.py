"""Draws of single avalanches, against the distributions that they are drawn from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.event_draws import (
    fronts_of,
    new_avalanches,
    read_with_errors,
    recorded_avalanches,
)
from skred.inference.hierarchical.population import population_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.laws import load_law

N = 3000
PCM = load_law("pcm")


@pytest.fixture(scope="module")
def hierarchical(problem: Any) -> HierarchicalProblem:
    """Ryggfonn with the release of every other event uncertain."""
    events = tuple(
        replace(event, release_s_m=5.0, release_sd_m=10.0 if number % 2 else None)
        for number, event in enumerate(problem.campaign.events[:4])
    )
    campaign = replace(
        problem.campaign,
        events=events,
        values=problem.campaign.values[:4],
        status=problem.campaign.status[:4],
        stated_sd=problem.campaign.stated_sd[:4],
    )
    return HierarchicalProblem(campaign, problem.terrain)


def samples(n: int = N) -> dict[str, np.ndarray]:
    values = {
        "dry_friction": 0.3,
        "turbulent_drag": 0.003,
        "dry_friction_spread": 0.2,
        "turbulent_drag_spread": 0.4,
        "dry_friction_turbulent_drag_correlation": -0.6,
    }
    return {name: np.full(n, value) for name, value in values.items()}


def test_new_avalanches_have_the_population_s_moments(hierarchical: HierarchicalProblem) -> None:
    drawn = new_avalanches(hierarchical, PCM, samples(), np.random.default_rng(1))
    logs = np.log(drawn.strengths).reshape(-1, 2)
    assert logs.mean(axis=0) == pytest.approx(np.log([0.3, 0.003]), abs=0.02)
    assert logs.std(axis=0) == pytest.approx([0.2, 0.4], rel=0.03)
    assert np.corrcoef(logs.T)[0, 1] == pytest.approx(-0.6, abs=0.03)


def test_releases_are_cut_off_where_the_track_begins(hierarchical: HierarchicalProblem) -> None:
    releases = new_avalanches(hierarchical, PCM, samples(), np.random.default_rng(2)).releases
    assert np.all(releases[:, ::2] == 5.0)
    assert kstest(releases[:, 1], truncnorm(-0.5, np.inf, loc=5.0, scale=10.0).cdf).pvalue > 1e-3


def test_recorded_avalanches_are_those_of_importance_sampling(hierarchical: HierarchicalProblem) -> None:
    """Means against new avalanches weighted by their likelihood: another route to the same posterior."""
    from skred.inference.reading_density import log_likelihoods

    rng = np.random.default_rng(3)
    drawn = recorded_avalanches(hierarchical, PCM, samples(), rng)
    proposed = new_avalanches(hierarchical, PCM, samples(60_000), rng)
    fronts = hierarchical.fronts(PCM.mechanisms)
    from skred.physics.kernel.fronts import simulate

    for event in range(4):
        strengths, releases = proposed.strengths[:, event], proposed.releases[:, event].copy()
        strengths = np.ascontiguousarray(strengths)
        predictions = simulate(strengths, releases, fronts.path, fronts.law, fronts.sensors)
        which = np.full(len(releases), event)
        log_l = log_likelihoods(which, predictions, fronts.readings, fronts.errors)
        weights = np.exp(log_l - log_l.max())
        weights /= weights.sum()
        effective = 1.0 / np.sum(weights**2)
        if effective < 100:
            continue
        for k, own in enumerate(np.log(drawn.strengths[:, event]).T):
            values = np.log(strengths[:, k])
            mean = weights @ values
            sd = np.sqrt(weights @ (values - mean) ** 2)
            error = sd * np.sqrt(1.0 / effective + 1.0 / N)
            assert abs(own.mean() - mean) < 4.5 * error
            assert own.std() == pytest.approx(sd, rel=0.05 + 4.0 / np.sqrt(effective))


def test_fronts_are_the_kernel_s(hierarchical: HierarchicalProblem) -> None:
    drawn = new_avalanches(hierarchical, PCM, samples(5), np.random.default_rng(4))
    rows = fronts_of(hierarchical, PCM, drawn)
    assert rows.shape == (5, 4, 5) and np.array_equal(rows[..., 3], rows[..., 4])
    one = hierarchical.predict(PCM.mechanisms, drawn.strengths[2, 3][None], drawn.releases[2, 3][None])
    np.testing.assert_array_equal(rows[2, 3], one[0])


@pytest.mark.parametrize("name", ERROR_MODELS)
def test_readings_scatter_as_the_error_model_says(hierarchical: HierarchicalProblem, name: str) -> None:
    problem = replace(hierarchical, error_model=ERROR_MODELS[name])
    front = np.array([40.0, 30.0, 25.0, 2100.0, 2100.0])
    readings, reached = read_with_errors(problem, np.tile(front, (40_000, 1)), np.random.default_rng(5))
    assert reached.all()
    z = (readings[:, :3] - front[:3]) / np.hypot(0.1 * front[:3], 1.0)
    variance = {
        "normal": 1.0,
        "robust": 1.0 + 0.011 * 35.0,
        "student": 2.0,
        "correlated": 1.0,
        "scaled": np.exp(2 * 0.5**2),
    }[name]
    assert z.var() == pytest.approx(variance, rel=0.15 if name == "student" else 0.06)
    together = np.corrcoef(z.T)[0, 1]
    assert together == pytest.approx(0.5 if name == "correlated" else 0.0, abs=0.03)


def test_a_front_near_a_sensor_is_seen_there_or_not(hierarchical: HierarchicalProblem) -> None:
    """CD stands at 1810 m: a stop 4 m below it is seen beyond it with Phi(0.5)."""
    front = np.tile([20.0, 5.0, 0.0, 1814.0, 1814.0], (20_000, 1))
    readings, reached = read_with_errors(hierarchical, front, np.random.default_rng(6))
    assert reached[:, 0].all() and not reached[:, 2].any() and reached[:, 3].all()
    assert reached[:, 1].mean() == pytest.approx(norm.cdf(0.5), abs=0.015)
    assert np.all(readings[:, :3] >= 0.0) and np.all(readings[~reached[:, 1], 1] == 0.0)


def test_population_of_is_what_was_asked_for() -> None:
    means, factors = population_of(PCM, samples(2))
    np.testing.assert_allclose(means[0], np.log([0.3, 0.003]))
    covariance = factors[1] @ factors[1].T
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.2, 0.4], rtol=1e-5)
    assert covariance[0, 1] / 0.08 == pytest.approx(-0.6, abs=1e-5)
