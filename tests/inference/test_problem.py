"""The pooled problem against the plain likelihood of the recordings' covariance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skred.campaign import Status
from skred.inference.pooled.density import pooled_log_density
from skred.inference.pooled.problem import pooled_problem
from skred.inference.pooled.recordings_covariance import observed_log_likelihood
from skred.physics.laws import load_law

LAW = load_law("pcm")
STRENGTHS = np.array([[0.28, 0.0023], [0.2, 0.004], [0.6, 0.001], [0.05, 0.0002], [2.0, 0.01]])


@pytest.mark.parametrize("shift", [0.0, -1.0, 2.0])
def test_density_of_a_response_is_the_likelihood_of_a_mean(problem: Any, shift: float) -> None:
    mean = problem.recorded_mean + shift * np.sqrt(np.diag(problem.covariance))
    expected = observed_log_likelihood(problem.values, problem.not_reached, mean, problem.covariance)
    assert_allclose(pooled_log_density(mean[None], problem.arrays).sum(), expected, rtol=1e-9)


@pytest.mark.parametrize("strengths", STRENGTHS.tolist())
def test_log_density_event_by_event(problem: Any, strengths: list[float]) -> None:
    rows = np.array([strengths])
    response = problem.simulate(LAW.mechanisms, rows)[0]
    expected = [
        observed_log_likelihood(
            problem.values[[e]], problem.not_reached[[e]], response[e], problem.covariance
        )
        for e in range(problem.campaign.n_events)
    ]
    assert_allclose(problem.log_density(LAW.mechanisms, rows)[0], expected, rtol=1e-6)


def test_the_covariance_is_where_the_recordings_are_likeliest(problem: Any) -> None:
    def total(mean: np.ndarray, covariance: np.ndarray) -> float:
        return observed_log_likelihood(problem.values, problem.not_reached, mean, covariance)

    best = total(problem.recorded_mean, problem.covariance)
    for factor in (0.9, 1.1):
        assert total(problem.recorded_mean * factor, problem.covariance) < best
        assert total(problem.recorded_mean, problem.covariance * factor) < best


def test_every_event_starts_from_its_own_place(problem: Any, two_releases: Any) -> None:
    assert_allclose(two_releases.releases, [0.0, 700.0])
    both = two_releases.simulate(LAW.mechanisms, STRENGTHS)
    upper = problem.simulate(LAW.mechanisms, STRENGTHS)
    assert_allclose(both[:, ::2], upper[:, ::2], rtol=1e-12)
    assert np.abs(both[0, 1] - upper[0, 1]).max() > 0.1
    lower_only = replace(
        problem,
        campaign=replace(
            problem.campaign, events=tuple(replace(e, release_s_m=700.0) for e in problem.campaign.events)
        ),
    )
    assert_allclose(both[:, 1::2], lower_only.simulate(LAW.mechanisms, STRENGTHS)[:, 1::2], rtol=1e-12)
    density = two_releases.log_density(LAW.mechanisms, STRENGTHS)
    assert_allclose(density[:, ::2], problem.log_density(LAW.mechanisms, STRENGTHS)[:, ::2], rtol=1e-12)
    assert_allclose(density[:, 1::2], lower_only.log_density(LAW.mechanisms, STRENGTHS)[:, 1::2], rtol=1e-12)


def test_readings_are_nan_where_there_is_none(problem: Any) -> None:
    assert (
        np.isnan(problem.values[~problem.observed]).all()
        and np.isfinite(problem.values[problem.observed]).all()
    )
    assert not np.any(problem.observed & problem.not_reached)
    assert problem.coords == {
        "event": list(problem.campaign.event_ids),
        "sensor": list(problem.campaign.sensor_ids),
    }


def test_smoothing_changes_the_terrain_and_not_the_recordings(problem: Any) -> None:
    smooth = pooled_problem(problem.campaign, smoothing_m=40.0)
    assert smooth.terrain.smoothing_m == 40.0
    assert np.abs(smooth.terrain.curvature).max() < np.abs(problem.terrain.curvature).max()
    assert_allclose(smooth.covariance, problem.covariance, rtol=1e-12)


def test_recordings_that_do_not_determine_their_covariance_are_refused(problem: Any) -> None:
    status = problem.campaign.status.copy()
    status[:20, 0] = Status.MISSING
    values = np.where(status == Status.OBSERVED, problem.campaign.values, np.nan)
    with pytest.raises(ValueError, match="covariance needs at least"):
        pooled_problem(replace(problem.campaign, values=values, status=status))
