"""Exact leave-one-event-out against a sum over a grid, and against importance sampling."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import arviz as az
import numpy as np
import pymc as pm
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.leave_one_out import REFIT_DRAWS, ExactLoo, exact_leave_one_out, samples_of


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
    # Both are by draws; the exact one is held against the grid above.
    assert_allclose(np.asarray(loo.elpd_i)[reliable], exact.pointwise[reliable], atol=0.08)


def test_leaving_out_costs(exact: ExactLoo, calibration: Any) -> None:
    """An event is predicted worse without itself than with itself."""
    terms = calibration.tree["log_likelihood"]["recordings"].values
    with_it = np.log(np.exp(terms).mean(axis=(0, 1)))
    assert np.all(exact.pointwise < with_it + 0.01)


def test_refits_are_the_same_in_threads(monkeypatch: pytest.MonkeyPatch, calibration: Any) -> None:
    found = []
    for said in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", said)
        found.append(exact_leave_one_out(calibration.model, calibration.step, ["first", "second"], 7))
    assert_array_equal(found[0].pointwise, found[1].pointwise)
    assert found[0].mcse == found[1].mcse


@pytest.mark.slow
def test_the_stated_error_is_that_of_repeated_refits(calibration: Any) -> None:
    """Of the sum over three avalanches, by fourteen seeds."""
    model, step = calibration.model, calibration.step
    found = [exact_leave_one_out(model, step, ["a", "b", "c"], seed) for seed in range(14)]
    stated = np.sqrt(np.mean([one.mcse**2 for one in found]))
    assert 0.5 < np.std([one.elpd for one in found], ddof=1) / stated < 1.6


class ChainsApart:
    """Stands for a sampler whose chains end far from each other without the first event."""

    n_terms = 2

    def __init__(self, until: float = np.inf) -> None:
        self.chains, self.until = itertools.count(), until

    def adapt(self, *_: Any) -> None: ...

    def run(
        self, q: np.ndarray, n: int, rng: np.random.Generator, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        far = 5.0 * next(self.chains) if weights[0] == 0.0 and n < self.until else 0.0
        return far + rng.standard_normal((n, len(q))), np.zeros((n, self.n_terms))


class Timed(JointMetropolis):
    """Remembers how long its chains were."""

    lengths: tuple[int, ...] = ()

    def run(self, q: Any, n_draws: int, *others: Any) -> Any:
        self.lengths += (n_draws,)
        return super().run(q, n_draws, *others)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_many_parameters_are_adapted_to_for_longer(seed: int) -> None:
    """Seven, of unlike scales: no refit is run again for longer, as both are after 500 draws."""
    rng, scales = np.random.default_rng(0), np.logspace(-2.0, 0.0, 7)
    design, values = rng.standard_normal((12, 7)), rng.standard_normal(12)
    with pm.Model() as model:
        free = [pm.Normal(f"x{k}", 0.0, scale) for k, scale in enumerate(scales)]
        mean = pm.math.dot(design, pm.math.stack(free) / scales)
        pm.Normal("recordings", mean, 0.5, observed=values)
    step = Timed(model=model, pointwise="recordings")
    names = [f"e{k}" for k in range(12)]
    result = exact_leave_one_out(model, step, names, seed, which=[0])
    assert result.failed == () and max(step.lengths) == 4 * REFIT_DRAWS


def test_refits_start_where_all_recordings_lead() -> None:
    """Beside a mode that nothing leads out of, at which a model starts by default; r-hat is good there."""
    sd = 0.01

    def logp(value: Any, x: Any) -> Any:
        def peak(centre: Any) -> Any:
            return -0.5 * ((x - centre) / sd) ** 2 - np.log(sd * np.sqrt(2.0 * np.pi))

        return pm.math.logaddexp(peak(value) - 0.01, peak(value + 50.0) - 5.0)

    values = 50.0 + sd * np.array([-1.0, 0.3, 0.8])
    with pm.Model() as model:
        x = pm.Normal("x", 0.0, 100.0, initval=100.0)
        pm.CustomDist("recordings", x, logp=logp, observed=values)
    step = JointMetropolis(model=model, pointwise="recordings")
    near = {"x": 50.0 + sd * np.random.default_rng(3).standard_normal(400) / np.sqrt(3.0)}
    names = ["a", "b", "c"]
    far, found = (exact_leave_one_out(model, step, names, 4, near=one) for one in (None, near))
    rest = np.array([values[[k for k in range(3) if k != left]].mean() for left in range(3)])
    density = -0.5 * ((values - rest) / sd) ** 2 / 1.5 - 0.5 * np.log(2.0 * np.pi * 1.5 * sd**2) - 0.01
    assert far.failed == () and far.elpd < density.sum() - 10.0
    assert found.failed == ()
    assert_allclose(found.pointwise, density, atol=0.1)


def test_a_refit_that_does_not_converge_is_named(calibration: Any) -> None:
    apart: Any = ChainsApart()
    result = exact_leave_one_out(calibration.model, apart, ["bad", "good"], 0)
    assert result.failed == ("bad",)


def test_a_refit_that_does_not_converge_is_run_longer(calibration: Any) -> None:
    slow: Any = ChainsApart(until=3 * REFIT_DRAWS * max(1, len(calibration.step.vars) // 2))
    result = exact_leave_one_out(calibration.model, slow, ["slow", "good"], 0)
    assert result.failed == () and abs(result.draws[0].mean()) < 0.1
    assert result.draws[0].shape == result.draws[1].shape


def test_draws_of_a_refit_are_those_of_the_weighted_posterior(exact: ExactLoo, calibration: Any) -> None:
    """Each parameter by the other events: back from its transform, against importance sampling."""
    samples = samples_of(calibration.model, calibration.step, exact.draws[:3])
    posterior = calibration.tree["posterior"].to_dataset()
    terms = calibration.tree["log_likelihood"]["recordings"].transpose("chain", "draw", ...).values
    assert len(samples) == 3
    for event, one in enumerate(samples):
        weights = np.exp(-terms[..., event].ravel())
        for parameter in calibration.problem.parameters(calibration.law):
            draws = posterior[parameter.name].transpose("chain", "draw").values.ravel()
            expected, sd = np.average(draws, weights=weights), draws.std()
            assert abs(one[parameter.name].mean() - expected) < 0.15 * sd
            assert 0.8 * sd < one[parameter.name].std() < 1.25 * sd
