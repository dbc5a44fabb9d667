"""The slow reference of log Bayes factors: its prior, its event integrals, its population integral."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.stats import multivariate_normal

from benchmarks.reference.event_sums import EventNodes
from benchmarks.reference.lattice import Cloud, narrow_precision, population_envelope, resolve
from benchmarks.reference.population_integral import integrate_population, log_likelihood, nested_evidence
from benchmarks.reference.population_prior import (
    covariance_of,
    factors_of,
    from_cube,
    log_prior,
    n_coordinates,
)
from benchmarks.reference.search import search, wide_envelope
from benchmarks.reference.table import summary, table
from skred.diagnosis.evidence import marginal, population_target

LOG_SCALE = np.log([0.5, 0.01, 3.0])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_prior_transform_has_the_density(n: int) -> None:
    rng = np.random.default_rng(n)
    cube = rng.uniform(0.02, 0.98, (40, n_coordinates(n)))
    step = 1e-6
    slopes = (from_cube(cube + step, LOG_SCALE[:n]) - from_cube(cube - step, LOG_SCALE[:n])) / (2.0 * step)
    found = log_prior(from_cube(cube, LOG_SCALE[:n]), LOG_SCALE[:n])
    np.testing.assert_allclose(found, -np.log(slopes).sum(axis=1), atol=1e-5)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_prior_is_that_of_the_diagnosis(n: int) -> None:
    cube = np.random.default_rng(n).uniform(0.02, 0.98, (20, n_coordinates(n)))
    psi = from_cube(cube, LOG_SCALE[:n])
    theirs = [population_target.log_prior(one, n, LOG_SCALE[:n]) for one in psi]
    np.testing.assert_allclose(log_prior(psi, LOG_SCALE[:n]), theirs, rtol=1e-9)
    np.testing.assert_allclose(covariance_of(psi, n), marginal.population_at(psi, n).covariance, rtol=1e-9)


@dataclass(frozen=True)
class LinearEvents:
    """Events whose readings are linear in their log coefficients and releases, with normal errors."""

    design: Any
    readings: Any
    loose: Any

    @property
    def n_events(self) -> int:
        return len(self.readings)

    @property
    def n(self) -> int:
        return int(self.design.shape[2]) - 1

    def log_likelihood(self, events: Any, points: Any) -> Any:
        seen = np.einsum("kij,kj->ki", self.design[events], points)
        square = np.sum((self.readings[events] - seen) ** 2, axis=1)
        return -0.5 * square - 0.5 * seen.shape[1] * math.log(2.0 * math.pi)

    def exact(self, mean: Any, covariance: Any) -> Any:
        """Log likelihood of each event over a population."""
        size, result = self.n + 1, []
        for design, readings, loose in zip(self.design, self.readings, self.loose, strict=True):
            cover = np.zeros((size, size))
            cover[: self.n, : self.n] = covariance
            cover[self.n, self.n] = float(loose)
            total = design @ cover @ design.T + np.eye(len(readings))
            result.append(multivariate_normal(design[:, : self.n] @ mean, total).logpdf(readings))
        return np.array(result)


def linear_events(n: int, loose: bool, n_events: int = 6) -> tuple[LinearEvents, Any]:
    rng = np.random.default_rng([n, loose])
    log_scale = LOG_SCALE[:n]
    truth = log_scale - 0.8 + 0.13 * rng.standard_normal((n_events, n))
    design = rng.standard_normal((n_events, 4, n + 1)) * np.append(np.full(n, 30.0), 3.0)
    released = rng.standard_normal((n_events, 1)) * loose
    points = np.concatenate([truth, released], axis=1)
    readings = np.einsum("kij,kj->ki", design, points) + rng.standard_normal((n_events, 4))
    return LinearEvents(design, readings, np.full(n_events, loose)), log_scale


def nodes_of(events: Any, log_scale: Any, rng: np.random.Generator) -> tuple[EventNodes, Any]:
    n = events.n
    envelope = wide_envelope(log_scale)
    points, heights = search(events, log_scale, envelope, rng)
    clouds = [Cloud(own, height) for own, height in zip(points, heights, strict=True)]
    rough = resolve(events, clouds, envelope, narrow_precision(None, n), rng, 1.3, 9.0)
    draws = integrate_population(rough.nodes, log_scale, rng, wanted=300.0).draws
    fine = resolve(events, rough.clouds, population_envelope(draws, n), narrow_precision(draws, n), rng)
    return fine.nodes, draws


@pytest.mark.parametrize(("n", "loose"), [(1, False), (1, True), (2, False), (2, True)])
def test_event_integrals_are_those_of_a_linear_model(n: int, loose: bool) -> None:
    events, log_scale = linear_events(n, loose)
    nodes, draws = nodes_of(events, log_scale, np.random.default_rng(1))
    usual = draws[::16]
    found = log_likelihood(usual, nodes, n)
    covariance = covariance_of(usual, n)
    exact = [events.exact(mean, cover).sum() for mean, cover in zip(usual[:, :n], covariance, strict=True)]
    np.testing.assert_allclose(found, exact, atol=5e-3)


def by_quadrature(nodes: EventNodes, log_scale: Any, draws: Any) -> float:
    """Log evidence of one coefficient's population, on a grid of median and spread."""
    low, high = draws.mean(axis=0) - 8.0 * draws.std(axis=0), draws.mean(axis=0) + 8.0 * draws.std(axis=0)
    axes = [np.linspace(low[k], high[k], 161) for k in range(2)]
    psi = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    height = (log_likelihood(psi, nodes, 1) + log_prior(psi, log_scale)).reshape(161, 161)
    most = height.max()
    return float(most + np.log(simpson(simpson(np.exp(height - most), x=axes[1]), x=axes[0])))


def test_the_population_integral_by_three_routes() -> None:
    pytest.importorskip("dynesty")
    events, log_scale = linear_events(1, loose=False)
    nodes, draws = nodes_of(events, log_scale, np.random.default_rng(2))
    found = integrate_population(nodes, log_scale, np.random.default_rng(3))
    assert found.error < 0.05
    assert found.log_evidence == pytest.approx(by_quadrature(nodes, log_scale, draws), abs=4.0 * found.error)
    nested, error = nested_evidence(nodes, log_scale, 4, n_live=60)
    assert nested == pytest.approx(found.log_evidence, abs=4.0 * error)


def test_two_coefficients_by_two_routes() -> None:
    pytest.importorskip("dynesty")
    events, log_scale = linear_events(2, loose=False)
    nodes, _ = nodes_of(events, log_scale, np.random.default_rng(2))
    found = integrate_population(nodes, log_scale, np.random.default_rng(3))
    again = integrate_population(nodes, log_scale, np.random.default_rng(5))
    assert found.log_evidence == pytest.approx(again.log_evidence, abs=6.0 * found.error)
    nested, error = nested_evidence(nodes, log_scale, 4, n_live=50)
    assert nested == pytest.approx(found.log_evidence, abs=4.0 * error)


def test_factors_of_three_coefficients_are_lower_triangular_and_of_unit_correlation() -> None:
    psi = np.zeros((2, n_coordinates(3)))
    psi[:, 6:] = np.arctanh([0.3, -0.5, 0.2])
    factor = factors_of(psi, 3)[0]
    assert np.allclose(factor, np.tril(factor))
    np.testing.assert_allclose(np.diag(factor @ factor.T), 1.0)


def test_the_table_counts_what_is_lost_and_what_fails() -> None:
    def record(reference: float, engine: float | None) -> dict[str, Any]:
        return {
            **{"base": "pcm", "recorded": "dense", "source": "simulated", "mechanism": "obstacle"},
            "shapes": [{}],
            "reference": {"log_bayes_factor": reference, "error": 0.1, "seconds": 1.0},
            "engine": {"log_bayes_factor": engine, "seconds": 1.0},
        }

    found = summary([record(20.0, -1.0), record(5.0, 5.5), record(12.0, None), record(0.0, 0.2)])
    assert found["all"]["lost"] == 2
    assert found["all"]["failed"] == 1
    assert found["all"]["beyond_3"] == 2
    assert found["all"]["median"] == pytest.approx(0.5)
    assert "| base: pcm | 4 |" in table(found)


@pytest.mark.slow
def test_a_simulated_campaign_of_one_coefficient() -> None:
    from benchmarks.reference.bayes_factor import nothing_added, reference_factor
    from benchmarks.reference.engine import engine_log_bayes_factor, fitted_base
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.physics.laws import load_law
    from skred.physics.mechanisms import mechanisms
    from skred.physics.mechanisms.spec import Shape
    from skred.simulator.draw import draw_trial

    trial = draw_trial(5000, kind="sparse", base="coulomb", hidden="turbulent_drag", snr=7.0)
    problem, law = hierarchical_problem(trial.campaign), load_law("coulomb")
    plain, setting = nothing_added(problem, law, 1)
    at = plain.at(0.0)
    quadrature = by_quadrature(at.resolved.nodes, plain.log_scale, at.found.draws)
    assert at.found.log_evidence == pytest.approx(quadrature, abs=0.05)
    drag, shapes = mechanisms()["turbulent_drag"], [Shape()]
    found = reference_factor(plain, setting, drag, shapes, n_live=0)
    assert found.error < 0.2
    engine = engine_log_bayes_factor(fitted_base(problem, law), drag, shapes)
    assert engine == pytest.approx(found.log_bayes_factor, abs=0.5)
