"""The posterior of M2 by three routes: joint Metropolis, NUTS, and a sum over a grid."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_array_equal

from skred.campaign import read_campaign
from skred.campaign.template import write_template
from skred.inference.pooled.problem import pooled_problem
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior, starting_points
from skred.physics.laws import load_law

LAW = load_law("pcm")
PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
Z_LIMIT = 4.5
"""In Monte Carlo standard errors; some thirty comparisons."""


@pytest.fixture(scope="session")
def nuts(problem: Any, model_of: Callable[[str], Any]) -> xr.DataTree:
    model = model_of("pcm")
    settings = SamplerSettings("nuts", draws=1000, tune=1000, chains=2, seed=2)
    return sample_posterior(model, LAW, problem, sample_prior(model, LAW, 2), settings)


def z_scores(tree: Any, name: str, mean: float, sd: float, quantiles: list[float]) -> np.ndarray:
    draws = tree["posterior"][name].values
    posterior = tree["posterior"].to_dataset()[[name]]
    found = [draws.mean(), draws.std(ddof=1), *np.quantile(draws, PROBABILITIES)]
    errors = [az.mcse(posterior, method="mean"), az.mcse(posterior, method="sd")]
    errors += [az.mcse(posterior, method="quantile", prob=p) for p in PROBABILITIES]
    return (np.array(found) - [mean, sd, *quantiles]) / [float(error[name]) for error in errors]


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["metropolis", "nuts"])
@pytest.mark.parametrize("parameter", [0, 1])
def test_posterior_is_that_of_the_grid(
    sampler: str,
    parameter: int,
    calibration: Any,
    quadrature_of: Callable[[str], Any],
    request: pytest.FixtureRequest,
) -> None:
    tree = calibration.tree if sampler == "metropolis" else request.getfixturevalue("nuts")
    grid, name = quadrature_of("pcm"), LAW.parameter_names[parameter]
    quantiles = [grid.quantile(parameter, p) for p in PROBABILITIES]
    z = z_scores(tree, name, grid.mean[parameter], grid.sd[parameter], quantiles)
    assert np.abs(z).max() < Z_LIMIT, z
    assert np.abs(z_scores(tree, name, grid.mean[parameter] + grid.sd[parameter], 1.0, quantiles)[0]) > 10


def test_joint_shape_is_that_of_the_grid(calibration: Any, nuts: Any, quadrature_of: Any) -> None:
    """Cross moments in standard deviations; their Monte Carlo errors are 0.02 to 0.05."""
    grid = quadrature_of("pcm")

    def cross_moments(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        a, b = ((x - grid.mean) / grid.sd).T
        return np.array([weights @ (a * b), weights @ (a**2 * b), weights @ (a * b**2)])

    expected = cross_moments(grid.nodes, grid.weights)
    for tree in (calibration.tree, nuts):
        draws = np.column_stack([tree["posterior"][name].values.ravel() for name in LAW.parameter_names])
        found = cross_moments(draws, np.full(len(draws), 1 / len(draws)))
        assert np.all(np.abs(found - expected) < [0.12, 0.25, 0.25]), (found, expected)


def test_the_grid_holds_the_posterior(quadrature_of: Callable[[str], Any]) -> None:
    for law_id in ("pcm", "coulomb", "constant"):
        grid = quadrature_of(law_id)
        outer = grid.nodes > 0.9 * grid.nodes.max(axis=0)
        assert grid.weights[outer.any(axis=1)].sum() < 1e-12


def test_metropolis_passes_its_gate(calibration: Any) -> None:
    assert calibration.gate.passed, calibration.gate.problems
    assert calibration.gate.ess_bulk_min > 1000


def test_a_seed_reproduces(problem: Any, calibration: Any) -> None:
    prior = sample_prior(calibration.model, LAW, 0)
    draws = [
        sample_posterior(
            calibration.model,
            LAW,
            problem,
            prior,
            SamplerSettings(draws=20, tune=20, chains=2, seed=seed),
            step=calibration.step,
        )["posterior"]["dry_friction"].values
        for seed in (3, 3, 4)
    ]
    assert_array_equal(draws[0], draws[1])
    assert not np.any(draws[0] == draws[2])


def test_prior_draws_are_the_priors(calibration: Any) -> None:
    prior = sample_prior(calibration.model, LAW, 5, draws=4000)
    for mechanism, name in zip(LAW.mechanisms, LAW.parameter_names, strict=True):
        draws = prior[name].values
        assert draws.min() > 0
        scale = mechanism.strength.prior_scale
        assert abs(draws.mean() / (scale * np.sqrt(2 / np.pi)) - 1) < 0.06
        assert abs(np.mean(draws > 1.96 * scale) - 0.05) < 0.015


def test_each_chain_starts_from_the_likeliest_of_its_own(problem: Any, calibration: Any) -> None:
    """Apart from one another, and not on a plateau."""
    names = LAW.parameter_names
    prior = sample_prior(calibration.model, LAW, 0, draws=40)
    starts = starting_points(LAW, problem, prior, SamplerSettings(chains=4))
    assert len({start[names[0]] for start in starts}) == 4
    every = prior[names[0]].values.ravel()
    for chain, start in enumerate(starts):
        own = every[10 * chain : 10 * (chain + 1)]
        assert start[names[0]] in own
        rows = LAW.strength_rows({n: prior[n].values.ravel()[10 * chain : 10 * (chain + 1)] for n in names})
        best = problem.log_density(LAW.mechanisms, rows).sum(axis=1).argmax()
        assert start[names[0]] == own[best]


def test_chains_start_at_the_mode_that_holds_the_probability(tmp_path: Path) -> None:
    """On the filled example the mean front has a second mode, where it stops above the last sensor."""
    write_template(tmp_path / "example")
    example, law = pooled_problem(read_campaign(tmp_path / "example")), load_law("coulomb")
    prior = sample_prior(law.build(example), law, 0)
    starts = np.array(
        [one["dry_friction"] for one in starting_points(law, example, prior, SamplerSettings())]
    )
    places = np.linspace(0.3, 0.6, 3001)
    density = example.log_likelihood(law, {"dry_friction": places}).sum(axis=1)
    assert np.abs(starts - places[density.argmax()]).max() < 0.01
    apart = places[np.flatnonzero((density[1:-1] > density[:-2]) & (density[1:-1] > density[2:])) + 1]
    assert np.abs(apart - 0.368).min() < 0.005


def test_pymc_says_nothing(calibration: Any, problem: Any, caplog: pytest.LogCaptureFixture) -> None:
    prior = sample_prior(calibration.model, LAW, 0)
    settings = SamplerSettings(draws=5, tune=5, chains=2)
    sample_posterior(calibration.model, LAW, problem, prior, settings, step=calibration.step)
    assert [record.message for record in caplog.records if record.name.startswith("pymc")] == []
