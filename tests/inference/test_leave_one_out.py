"""Exact leave-one-event-out against a sum over a grid, and against importance sampling."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import arviz as az
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skred.inference.leave_one_out import ExactLoo, _mcse, exact_leave_one_out


@pytest.fixture(scope="module")
def exact(problem: Any, calibration: Any) -> ExactLoo:
    return exact_leave_one_out(calibration.model, calibration.step, problem.campaign.event_ids, 1)


def test_each_event_is_predicted_as_by_the_grid(exact: ExactLoo, quadrature_of: Callable[[str], Any]) -> None:
    difference = exact.pointwise - quadrature_of("pcm").leave_one_out
    assert exact.failed == ()
    # The error of the sum is some root of 22 errors of one event.
    one = exact.mcse / np.sqrt(len(difference))
    assert abs(difference.sum()) < 4.5 * exact.mcse
    assert np.sqrt(np.mean(difference**2)) < 2.0 * one
    assert np.abs(difference).max() < 0.05


def test_the_sum_is_known_well_enough(exact: ExactLoo) -> None:
    assert 0.0 < exact.mcse < 0.05
    assert exact.elpd == pytest.approx(exact.pointwise.sum())
    assert exact.se == pytest.approx(np.sqrt(22) * exact.pointwise.std(ddof=1))


def test_importance_sampling_agrees_where_it_is_reliable(exact: ExactLoo, calibration: Any) -> None:
    loo = az.loo(calibration.tree, var_name="recordings", pointwise=True)
    reliable = np.asarray(loo.pareto_k) < 0.5
    assert reliable.sum() > 15
    assert_allclose(np.asarray(loo.elpd_i)[reliable], exact.pointwise[reliable], atol=0.05)


def test_leaving_out_costs(exact: ExactLoo, calibration: Any) -> None:
    """An event is predicted worse without itself than with itself."""
    terms = calibration.tree["log_likelihood"]["recordings"].values
    with_it = np.log(np.exp(terms).mean(axis=(0, 1)))
    assert np.all(exact.pointwise < with_it + 0.01)


def test_weights_are_restored_even_after_an_error(problem: Any, calibration: Any) -> None:
    def tell(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exact_leave_one_out(calibration.model, calibration.step, problem.campaign.event_ids, 1, tell)
    assert_array_equal(calibration.step.weights, 1.0)


def test_it_tells_how_far_it_is_and_reproduces(calibration: Any) -> None:
    told: list[tuple[int, int]] = []
    runs = [
        exact_leave_one_out(
            calibration.model, calibration.step, ["first", "second"], 7, lambda *args: told.append(args)
        ).pointwise
        for _ in range(2)
    ]
    assert told == [(1, 2), (2, 2)] * 2
    assert_array_equal(runs[0], runs[1])


def test_error_of_a_log_mean() -> None:
    """Against the delta method for independent draws."""
    rng = np.random.default_rng(0)
    densities = -1000.0 + 0.3 * rng.standard_normal((3, 4, 5000))
    expected = np.sqrt(np.exp(0.3**2) - 1) / np.sqrt(20_000)
    assert_allclose(_mcse(densities), expected, rtol=0.5)


def test_a_refit_that_does_not_converge_is_named(monkeypatch: pytest.MonkeyPatch, calibration: Any) -> None:
    import skred.inference.leave_one_out as module

    numbers = iter(range(100))

    def apart(step: Any, q: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        chain = next(numbers)
        far = 5.0 * chain if chain < module.REFIT_CHAINS else 0.0  # the first event's chains only
        return far + rng.standard_normal((500, 2)), np.zeros((500, 22))

    monkeypatch.setattr(module, "_refit", apart)
    result = exact_leave_one_out(calibration.model, calibration.step, ["bad", "good"], 0)
    assert result.failed == ("bad",)
