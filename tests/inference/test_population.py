"""The population: its factor by hand and symbolically, its names and priors, and populations of draws."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pymc as pm
import pytensor
import pytensor.tensor as pt
import pytest
from numpy.testing import assert_allclose
from scipy.stats import beta, lognorm

from skred.inference.hierarchical.population import (
    correlation_parameters,
    population_factor,
    population_of,
    population_variables,
    spread_parameters,
)
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms

THREE = [mechanisms()[name] for name in ("coulomb_friction", "turbulent_drag", "viscous_drag")]
SPREADS = [0.1, 0.7, 0.02]


def covariance_of(spreads: list[float], correlations: list[float]) -> np.ndarray:
    factor = np.array(population_factor(spreads, correlations), dtype=float)
    assert np.all(np.triu(factor, 1) == 0.0) and np.all(np.diag(factor) > 0.0)
    return factor @ factor.T


def test_one_strength() -> None:
    assert_allclose(covariance_of([0.3], []), [[0.09]], rtol=1e-12)


@pytest.mark.parametrize("r", [-1.0, -0.999, -0.4, 0.0, 0.7, 1.0])
def test_two_strengths(r: float) -> None:
    """At a correlation of one in size too, where the factor must not become singular."""
    expected = [[0.01, 0.07 * r], [0.07 * r, 0.49]]
    assert_allclose(covariance_of([0.1, 0.7], [r]), expected, rtol=2e-6)


@pytest.mark.parametrize("partial", [(0.5, -0.3, 0.6), (-0.9, 0.8, -0.7), (0.0, 0.0, 0.9), (0.2, 0.3, 0.0)])
def test_three_strengths(partial: tuple[float, float, float]) -> None:
    """The third is the partial correlation of the last two given the first."""
    covariance = covariance_of(SPREADS, list(partial))
    assert_allclose(np.sqrt(np.diag(covariance)), SPREADS, rtol=2e-6)
    r = covariance / np.outer(SPREADS, SPREADS)
    given_the_first = (r[1, 2] - r[0, 1] * r[0, 2]) / np.sqrt((1 - r[0, 1] ** 2) * (1 - r[0, 2] ** 2))
    assert_allclose([r[0, 1], r[0, 2], given_the_first], partial, atol=2e-5)


def test_wrong_number_of_correlations() -> None:
    with pytest.raises(ValueError):
        population_factor([0.1, 0.2], [])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_symbols_give_the_same(n: int) -> None:
    n_pairs = n * (n - 1) // 2
    spreads, correlations = pt.dvector("spreads"), pt.dvector("correlations")
    rows = population_factor(
        [spreads[i] for i in range(n)], [correlations[i] for i in range(n_pairs)], pt.sqrt
    )
    factor = pt.stack([pt.stack([pt.as_tensor_variable(value) for value in row]) for row in rows])
    function = pytensor.function(
        [spreads, correlations], factor, mode="FAST_COMPILE", on_unused_input="ignore"
    )
    values = np.array(SPREADS[:n]), np.array([0.5, -0.3, 0.6][:n_pairs])
    expected = np.array(population_factor(list(values[0]), list(values[1])))
    assert_allclose(function(*values), expected, rtol=1e-13)


def test_names_are_the_strengths_own() -> None:
    names = [parameter.name for parameter in spread_parameters(THREE)]
    assert names == ["dry_friction_spread", "turbulent_drag_spread", "viscous_drag_spread"]
    assert [parameter.name for parameter in correlation_parameters(THREE)] == [
        "dry_friction_turbulent_drag_correlation",
        "dry_friction_viscous_drag_correlation",
        "turbulent_drag_viscous_drag_correlation",
    ]
    for parameter in (*spread_parameters(THREE), *correlation_parameters(THREE)):
        assert parameter.unit == "1" and parameter.symbol
    assert correlation_parameters(THREE[:1]) == ()


@pytest.mark.parametrize("law_id", ["constant", "pcm", "voellmy"])
def test_populations_of_draws(law_id: str) -> None:
    """Medians in the law's own parameters; Voellmy's drag is g by its parameter."""
    law = load_law(law_id)
    rng = np.random.default_rng(0)
    names = [*law.parameter_names, *(p.name for p in spread_parameters(law.mechanisms))]
    samples: dict[str, Any] = {name: rng.uniform(0.1, 0.9, (2, 3)) for name in names}
    for parameter in correlation_parameters(law.mechanisms):
        samples[parameter.name] = rng.uniform(-0.9, 0.9, (2, 3))
    means, factors = population_of(law, samples)
    assert means.shape == (6, len(law.mechanisms)) and factors.shape == (6, *2 * (len(law.mechanisms),))
    draw = 4
    medians = [float(samples[name].ravel()[draw]) for name in law.parameter_names]
    if law_id == "voellmy":
        medians[1] = 9.81 / medians[1]
    assert_allclose(np.exp(means[draw]), medians, rtol=1e-3)
    covariance = factors[draw] @ factors[draw].T
    spreads = [samples[p.name].ravel()[draw] for p in spread_parameters(law.mechanisms)]
    assert_allclose(np.sqrt(np.diag(covariance)), spreads, rtol=2e-6)
    for (i, j), p in zip(
        combinations(range(len(spreads)), 2), correlation_parameters(law.mechanisms), strict=True
    ):
        found = covariance[i, j] / spreads[i] / spreads[j]
        assert_allclose(found, samples[p.name].ravel()[draw], rtol=1e-9)


@pytest.fixture(scope="module")
def population_model() -> pm.Model:
    with pm.Model() as model:
        pm.Deterministic("factor", population_variables(THREE))
    return model


@pytest.fixture(scope="module")
def prior_draws(population_model: pm.Model) -> dict[str, np.ndarray]:
    names = [variable.name for variable in population_model.free_RVs]
    draws = pm.draw([population_model[name] for name in [*names, "factor"]], draws=4000, random_seed=1)
    return dict(zip([*names, "factor"], draws, strict=True))


def test_variables_of_the_model(population_model: pm.Model) -> None:
    expected = [p.name for p in (*spread_parameters(THREE), *correlation_parameters(THREE))]
    assert [variable.name for variable in population_model.free_RVs] == expected


def test_prior_of_the_spreads(prior_draws: dict[str, np.ndarray]) -> None:
    for parameter in spread_parameters(THREE):
        draws = prior_draws[parameter.name]
        assert np.all(draws > 0)
        at = np.quantile(draws, [0.025, 0.5, 0.975])
        assert_allclose(at, lognorm.ppf([0.025, 0.5, 0.975], 0.6, scale=0.13), rtol=0.08)


def test_prior_of_the_correlations_is_lkj(prior_draws: dict[str, np.ndarray]) -> None:
    """Each marginal correlation, not only the partial ones, is 2 Beta(a, a) - 1 with a = eta - 1 + n / 2."""
    factors = prior_draws["factor"]
    covariance = factors @ factors.transpose(0, 2, 1)
    sd = np.sqrt(np.einsum("kii->ki", covariance))
    correlation = covariance / sd[:, :, None] / sd[:, None, :]
    probabilities = np.array([0.1, 0.25, 0.5, 0.75, 0.9])
    for i, j in combinations(range(3), 2):
        draws = correlation[:, i, j]
        assert np.abs(draws).max() <= 1.0
        expected = 2.0 * beta.ppf(probabilities, 2.5, 2.5) - 1.0
        assert_allclose(np.quantile(draws, probabilities), expected, atol=0.05)


def test_log_prior_is_the_density_on_the_transformed_scale(population_model: pm.Model) -> None:
    """Log density with the jacobians of log and logistic, at a point by hand."""
    spreads, partial = np.array(SPREADS), np.array([0.5, -0.3, 0.6])
    point = population_model.initial_point()
    transformed = [*np.log(spreads), *np.log((1 + partial) / (1 - partial))]
    assert len(point) == 6
    point = {name: np.asarray(value) for name, value in zip(point, transformed, strict=True)}
    log_prior = population_model.compile_logp(mode="FAST_COMPILE")(point)
    expected = (lognorm.logpdf(spreads, 0.6, scale=0.13) + np.log(spreads)).sum()
    for r, shape in zip(partial, [2.5, 2.5, 2.0], strict=True):
        expected += beta.logpdf((1 + r) / 2, shape, shape) - np.log(2)
        expected += np.log((1 - r) * (1 + r) / 2)
    assert_allclose(log_prior, expected, rtol=1e-7)
