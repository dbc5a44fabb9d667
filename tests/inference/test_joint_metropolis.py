"""The joint Metropolis on densities that are known, and in PyMC's machinery."""

from __future__ import annotations

from typing import Any

import arviz as az
import cloudpickle
import numpy as np
import pymc as pm
import pytensor.tensor as pt
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pymc.pytensorf import floatX

from skred.inference.joint_metropolis import JointMetropolis

MEAN = np.array([1.0, -2.0, 300.0])
SD = np.array([1.0, 0.01, 50.0])
CORRELATION = np.array([[1.0, 0.95, -0.5], [0.95, 1.0, -0.3], [-0.5, -0.3, 1.0]])
COVARIANCE = CORRELATION * np.outer(SD, SD)
READINGS = np.array([0.5, -1.0, 4.0])


def gaussian() -> pm.Model:
    """Correlated, and of very different scales."""
    with pm.Model() as model:
        pm.MvNormal("x", MEAN, COVARIANCE)
    return model


def mean_of_readings(readings: np.ndarray = READINGS) -> pm.Model:
    with pm.Model(coords={"event": np.arange(len(readings))}) as model:
        mean = pm.Normal("mean", 0.0, 10.0)
        pm.Normal("recordings", mean, 1.0, observed=readings, dims="event")
    return model


@pytest.fixture(scope="module")
def gaussian_model() -> pm.Model:
    return gaussian()


@pytest.fixture(scope="module")
def gaussian_step(gaussian_model: pm.Model) -> JointMetropolis:
    return JointMetropolis(model=gaussian_model)


@pytest.fixture(scope="module")
def readings_step() -> JointMetropolis:
    return JointMetropolis(model=mean_of_readings(), pointwise="recordings")


def sample(model: pm.Model, step: JointMetropolis, seed: int = 0, **settings: Any) -> Any:
    settings = {"draws": 500, "tune": 500, "chains": 2, **settings}
    with model:
        return pm.sample(
            step=step,
            cores=1,
            random_seed=seed,
            progressbar=False,
            compute_convergence_checks=False,
            **settings,
        )


def test_all_variables_move_together(gaussian_step: JointMetropolis) -> None:
    assert JointMetropolis.default_blocked is True
    with pm.Model() as model:
        pm.Normal("a")
        pm.HalfNormal("b")
        step = JointMetropolis(model=model)
    assert isinstance(step, JointMetropolis)  # not PyMC's compound of one step a variable
    assert [variable.name for variable in step.vars] == ["a", "b_log__"]


def test_moments_of_a_correlated_gaussian(gaussian_model: pm.Model, gaussian_step: JointMetropolis) -> None:
    tree = sample(gaussian_model, gaussian_step, draws=1000)
    draws = tree["posterior"]["x"]
    assert float(az.ess(tree)["x"].min()) > 300
    error = az.mcse(tree, method="mean")["x"].values
    assert np.all(np.abs(draws.mean(("chain", "draw")).values - MEAN) < 5 * error)
    found = np.cov(draws.values.reshape(-1, 3).T)
    # The error of a covariance from some 300 effective draws is about 8 % of the product of the sds.
    assert np.abs((found - COVARIANCE) / np.outer(SD, SD)).max() < 0.3
    assert_allclose(np.corrcoef(draws.values.reshape(-1, 3).T), CORRELATION, atol=0.12)


@pytest.mark.parametrize("sigma", [0.002])
def test_half_normal_at_its_boundary(sigma: float) -> None:
    with pm.Model() as model:
        pm.HalfNormal("x", sigma)
    tree = sample(model, JointMetropolis(model=model), draws=2000)
    draws = tree["posterior"]["x"].values
    assert draws.min() > 0
    for probability, exact in ((0.05, 0.0627), (0.5, 0.6745), (0.95, 1.96)):
        error = float(az.mcse(tree, method="quantile", prob=probability)["x"])
        assert abs(np.quantile(draws, probability) - exact * sigma) < 5 * error + 1e-4 * sigma


def taken_over() -> pm.Model:
    """Two positive variables of which the sum is known: on logarithms the posterior is a hook."""
    with pm.Model() as model:
        left, added = pm.HalfNormal("left", 1.0), pm.HalfNormal("added", 1.0)
        pm.Normal("recordings", pt.stack([left + added]), 0.002, observed=[0.4])
    return model


def test_what_takes_over_in_a_straight_line() -> None:
    """`left` given the sum is truncated normal: nearly even from 0 to 0.4; terms are those of the model."""
    model = taken_over()
    step = JointMetropolis(model=model, pointwise="recordings", straight=("left", "added"))
    tree = sample(model, step, draws=4000, tune=1000)
    left = tree["posterior"]["left"].values
    exact = np.exp(-0.5 * np.linspace(0.0, 0.4, 401) ** 2 - 0.5 * (0.4 - np.linspace(0.0, 0.4, 401)) ** 2)
    within = np.cumsum(exact) / exact.sum()
    size = float(az.ess(left))
    assert size > 1000
    for probability in (0.1, 0.5, 0.9):
        quantile = np.interp(probability, within, np.linspace(0.0, 0.4, 401))
        assert abs(np.mean(left < quantile) - probability) < 4.0 * np.sqrt(0.25 / size) + 0.005
    on_logarithms = sample(model, JointMetropolis(model=model), draws=4000, tune=1000)
    assert float(az.ess(on_logarithms["posterior"]["left"].values)) < 0.5 * size

    # `adapt` and `run` take and give PyMC's values, logarithms.
    q, rng = np.log([0.2, 0.2]), np.random.default_rng(0)
    step.adapt(q, 500, rng)
    assert_allclose(np.exp(q).sum(), 0.4, atol=0.02)
    draws, terms = step.run(q, 200, rng)
    assert_allclose(q, draws[-1])
    sums = np.exp(draws).sum(axis=1, keepdims=True)
    assert_allclose(
        terms, -0.5 * ((0.4 - sums) / 0.002) ** 2 - np.log(0.002) - 0.5 * np.log(2 * np.pi), rtol=1e-9
    )


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e5])
def test_the_unit_of_what_is_moved_itself_does_not_matter(unit: float) -> None:
    with pm.Model() as model:
        pm.LogNormal("small", np.log(0.3), 0.02)
        pm.LogNormal("other", np.log(unit), 0.3)
    tree = sample(model, JointMetropolis(model=model, straight=("small", "other")), draws=1500, tune=1000)
    assert min(float(az.ess(tree["posterior"][name].values)) for name in ("small", "other")) > 600
    assert abs(float(tree["posterior"]["other"].median()) / unit - 1.0) < 0.05


def test_what_is_moved_itself_stays_positive_where_nothing_has_density() -> None:
    with pm.Model() as model:
        x = pm.HalfNormal("x", 1.0)
        pm.Potential("nowhere", pt.switch(x > 0.0, -np.inf, 0.0))
    q = np.zeros(1)
    draws, _ = JointMetropolis(model=model, straight=("x",)).run(q, 2000, np.random.default_rng(0))
    assert np.isfinite(draws).all() and np.ptp(draws) > 1.0
    assert np.isfinite(q).all()


def test_a_name_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown"):
        JointMetropolis(model=taken_over(), straight=("left", "unknown"))


def test_weight_zero_removes_an_event_exactly(readings_step: JointMetropolis) -> None:
    """The same random numbers make the same chain as the model without that event."""
    without = JointMetropolis(model=mean_of_readings(READINGS[[0, 2]]), pointwise="recordings")
    assert without.n_terms == 2 and readings_step.n_terms == 3
    readings_step.adapt(np.zeros(1), 50, np.random.default_rng(2))
    without.mean, without.factor, without.log_scale = (
        readings_step.mean,
        readings_step.factor,
        readings_step.log_scale,
    )
    chains = [
        step.run(np.zeros(1), 200, np.random.default_rng(3), weights)
        for step, weights in ((readings_step, np.array([1.0, 0.0, 1.0])), (without, None))
    ]
    assert_allclose(chains[0][0], chains[1][0], rtol=1e-12)
    assert_allclose(chains[0][1][:, [0, 2]], chains[1][1], rtol=1e-10)


def test_terms_are_unweighted_log_densities(readings_step: JointMetropolis) -> None:
    weights = np.array([0.0, 2.0, 1.0])
    draws, terms = readings_step.run(np.zeros(1), 20, np.random.default_rng(0), weights)
    assert_allclose(terms, -0.5 * (draws - READINGS) ** 2 - 0.5 * np.log(2 * np.pi), rtol=1e-12)


def test_a_seed_reproduces(gaussian_model: pm.Model, gaussian_step: JointMetropolis) -> None:
    first, again, other = (
        sample(gaussian_model, gaussian_step, seed=seed, draws=20, tune=20)["posterior"]["x"].values
        for seed in (4, 4, 5)
    )
    assert_array_equal(first, again)
    assert not np.any(first == other)


def tuned(step: JointMetropolis) -> np.ndarray:
    """A place to go on from, the step adapted and tuning over."""
    q = MEAN.copy()
    step.adapt(q, 300, np.random.default_rng(0))
    return q


def test_state_carries_all_that_was_learnt(gaussian_step: JointMetropolis) -> None:
    q = tuned(gaussian_step)
    state = gaussian_step.sampling_state
    other = JointMetropolis(model=gaussian())
    other.sampling_state = state
    chains = [step.run(q.copy(), 30, np.random.default_rng(1))[0] for step in (gaussian_step, other)]
    assert_array_equal(*chains)


def test_state_puts_back_what_it_was(gaussian_step: JointMetropolis) -> None:
    """As between the chains of one process: the second starts from the state that the first had."""
    gaussian_step.reset_tuning()
    fresh = gaussian_step.sampling_state
    expected = gaussian_step.run(MEAN.copy(), 30, np.random.default_rng(1))[0]
    tuned(gaussian_step)
    gaussian_step.sampling_state = fresh
    assert_array_equal(gaussian_step.run(MEAN.copy(), 30, np.random.default_rng(1))[0], expected)


def test_the_proposal_is_fixed_after_tuning(gaussian_model: pm.Model, gaussian_step: JointMetropolis) -> None:
    tree = sample(gaussian_model, gaussian_step, draws=50, tune=50, chains=1, discard_tuned_samples=False)
    assert np.ptp(tree["sample_stats"]["scaling"].values) == 0
    assert np.ptp(tree["warmup_sample_stats"]["scaling"].values) > 0
    before = gaussian_step.sampling_state
    gaussian_step.run(MEAN.copy(), 50, np.random.default_rng(2))
    after = gaussian_step.sampling_state
    assert_array_equal(before.factor, after.factor)
    assert before.log_scale == after.log_scale and before.adaptations == after.adaptations == 50


@pytest.mark.parametrize("n_parameters", [1, 2, 3])
def test_acceptance_is_driven_to_its_target(n_parameters: int, gaussian_step: JointMetropolis) -> None:
    step, start = gaussian_step, MEAN.copy()
    if n_parameters < 3:
        with pm.Model() as model:
            pm.Normal("x", 0.0, 1e-3, shape=n_parameters)
        step, start = JointMetropolis(model=model), np.zeros(n_parameters)
    step.adapt(start, 1000, np.random.default_rng(0))
    with step_draws(step, start) as share:
        assert abs(share - {1: 0.44, 2: 0.35, 3: 0.25}[n_parameters]) < 0.08


class step_draws:
    """Share of single moves that changed the state."""

    def __init__(self, step: JointMetropolis, q: np.ndarray) -> None:
        self.step, self.q = step, q

    def __enter__(self) -> float:
        moves, self.step.moves_per_draw = self.step.moves_per_draw, 1
        draws = self.step.run(self.q, 3000, np.random.default_rng(1))[0]
        self.step.moves_per_draw = moves
        return float(np.mean(np.any(np.diff(draws, axis=0) != 0, axis=1)))

    def __exit__(self, *error: object) -> None: ...


def test_discrete_variables_are_refused() -> None:
    with pm.Model() as model:
        pm.Poisson("n", 3.0)
    with pytest.raises(ValueError, match="continuous"):
        JointMetropolis(model.value_vars, model=model)


def test_a_density_that_is_nan_is_never_accepted() -> None:
    with pm.Model() as model:
        x = pm.Normal("x")
        pm.Potential("undefined", pt.switch(x > 0.5, np.nan, 0.0))
    draws, _ = JointMetropolis(model=model).run(np.zeros(1), 500, np.random.default_rng(0))
    assert draws.max() <= 0.5 and draws.max() > 0.3 and draws.min() < -1.0


def test_a_chain_leaves_a_place_without_density() -> None:
    with pm.Model() as model:
        x = pm.Flat("x")
        pm.Potential("only_here", pt.switch(pt.abs(x) < 1.0, 0.0, -np.inf))
    q = np.array([3.0])
    draws, _ = JointMetropolis(model=model).run(q, 2000, np.random.default_rng(0))
    inside = np.abs(draws[:, 0]) < 1.0
    assert inside[-1]
    first = int(inside.argmax())
    assert inside[first:].all()  # and does not go back


def test_other_variables_may_have_another_step() -> None:
    """Their values reach the density anew at every draw."""
    with pm.Model() as model:
        a = pm.Normal("a", 2.0, 0.1)
        b = pm.Normal("b", a, 0.1)
        steps = [JointMetropolis([b], model=model), pm.Slice([a], model=model)]
        tree = sample(model, steps, draws=2000)  # type: ignore[arg-type]
    a_draws, b_draws = (tree["posterior"][name].values.ravel() for name in "ab")
    assert abs(np.corrcoef(a_draws, b_draws)[0, 1] - np.sqrt(0.5)) < 0.1
    assert abs(b_draws.mean() - 2.0) < 0.03 and abs(b_draws.std() - 0.1 * np.sqrt(2)) < 0.02


def test_data_may_be_set_anew() -> None:
    with pm.Model() as model:
        readings = pm.Data("readings", np.zeros(4))
        pm.Potential("likelihood", -0.5 * pt.sum((readings - pm.Flat("x")) ** 2))
    step = JointMetropolis(model=model)
    for value in (0.0, 10.0):
        pm.set_data({"readings": np.full(4, value)}, model=model)
        q, rng = np.array([value]), np.random.default_rng(0)
        step.adapt(q, 200, rng)
        draws, _ = step.run(q, 1000, rng)
        assert abs(draws.mean() - value) < 0.1 and abs(draws.std() - 0.5) < 0.1


def test_it_pickles(gaussian_step: JointMetropolis) -> None:
    """PyMC sends steps to its processes this way."""
    q = tuned(gaussian_step)
    copy = cloudpickle.loads(cloudpickle.dumps(gaussian_step))
    chains = [step.run(q.copy(), 10, np.random.default_rng(1))[0] for step in (gaussian_step, copy)]
    assert_array_equal(*chains)


def test_the_pooled_density_is_the_models(problem: Any, calibration: Any) -> None:
    """The terms the chains ran on, from three routes."""
    names = calibration.law.parameter_names
    q = np.log([0.28, 0.0023])
    draws, terms = calibration.step.run(q, 5, np.random.default_rng(0))
    assert [variable.name for variable in calibration.step.vars] == [f"{name}_log__" for name in names]
    assert_allclose(terms, problem.log_density(calibration.law.mechanisms, np.exp(draws)), rtol=1e-12)
    logp = calibration.model.compile_logp(vars=calibration.model["recordings"], sum=False)
    point = {f"{name}_log__": floatX(value) for name, value in zip(names, draws[-1], strict=True)}
    assert_allclose(terms[-1], logp(point)[0], rtol=1e-12)
