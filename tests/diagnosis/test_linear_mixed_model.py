"""Efficient scores against dense generalised least squares; the population fit against simulated ones."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import sparse_base
from numpy.testing import assert_allclose

from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Modes, Population, Rows
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import (
    MeanPrior,
    efficient_scores,
    fit_population,
    mean_prior,
)
from skred.inference.error_model import ERROR_MODELS, EventReadings

N_EVENTS, N_COLUMNS, N_DIRECTIONS = 4, 5, 3


def random_inputs(n: int, n_groups: int, seed: int) -> tuple[Modes, Rows, Population, MeanPrior]:
    rng = np.random.default_rng(seed)
    n_rows = n_groups * N_EVENTS
    curvature = rng.uniform(0.2, 3.0, (n_rows, N_COLUMNS))
    curvature[rng.random(curvature.shape) < 0.2] = 0.0  # no reading
    slope = np.where(curvature > 0.0, rng.standard_normal(curvature.shape), 0.0)
    factor = rng.standard_normal((n_groups, n, n)) + 2.0 * np.eye(n)
    population = Population(
        rng.standard_normal((n_groups, n)), 0.05 * np.einsum("gij,gkj->gik", factor, factor)
    )
    points = rng.standard_normal((n_rows, n + 1))
    modes = Modes(
        points,
        points,
        np.zeros((n_rows, N_COLUMNS)),
        rng.standard_normal((n_rows, N_COLUMNS, n + 1)),
        rng.standard_normal((n_rows, N_COLUMNS, N_DIRECTIONS)),
        slope,
        curvature,
        # Less than all of it: what is left is positive.
        np.sqrt(curvature) * rng.uniform(0.2, 0.9, curvature.shape) / np.sqrt(N_COLUMNS),
    )
    empty = np.zeros((n_rows, 0))
    readings = EventReadings(
        empty, empty > 0, empty, *[np.zeros(0)] * 3, *[np.zeros(n_rows)] * 2, 8.0, empty, empty
    )
    group = np.repeat(np.arange(n_groups), N_EVENTS)
    rows = Rows(np.tile(np.arange(N_EVENTS), n_groups), group, readings, ERROR_MODELS["normal"].errors)
    return modes, rows, population, MeanPrior(rng.standard_normal(n), rng.uniform(0.3, 2.0, n))


def dense(
    modes: Modes, rows: Rows, population: Population, prior: MeanPrior, group: int, n_free: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Score and information with everything written out: V = R + J S J' + mean's prior, for all events."""
    n = population.mean.shape[1]
    own = np.zeros((n + 1, n + 1))
    own[:n, :n], own[n, n] = population.covariance[group], 1.0
    residuals, by_mean, added, blocks = [], [], [], []
    for row in np.flatnonzero(rows.group == group):
        seen = modes.curvature[row] > 0.0
        jacobian = modes.by_points[row, seen]
        deviation = modes.points[row] - np.append(population.mean[group], 0.0)
        shared = modes.shared[row, seen]
        covariance = np.linalg.inv(np.diag(modes.curvature[row, seen]) - np.outer(shared, shared))
        residuals.append(covariance @ modes.slope[row, seen] + jacobian @ deviation)
        by_mean.append(jacobian[:, :n])
        added.append(modes.by_strengths[row, seen])
        blocks.append(covariance + jacobian @ own @ jacobian.T)
    mean, x = np.vstack(by_mean), np.vstack(added)
    cover = mean @ np.diag(prior.sd**2) @ mean.T
    start = 0
    for block in blocks:
        cover[start : start + len(block), start : start + len(block)] += block
        start += len(block)
    residual = np.concatenate(residuals) - mean @ (prior.mean - population.mean[group])
    project = np.linalg.inv(cover)
    if n_free:
        free, x = x[:, :n_free], x[:, n_free:]
        taken = project @ free
        project = project - taken @ np.linalg.solve(free.T @ taken, taken.T)
    return x.T @ project @ residual, x.T @ project @ x


@pytest.mark.parametrize("n,n_groups", [(1, 1), (2, 1), (2, 3), (3, 2)])
def test_efficient_scores_are_generalised_least_squares(n: int, n_groups: int) -> None:
    inputs = random_inputs(n, n_groups, seed=n + 10 * n_groups)
    found = efficient_scores(*inputs)
    modes, rows, _, _ = inputs
    for group in range(n_groups):
        score, information = dense(*inputs, group)
        assert_allclose(found.score[group], score, rtol=1e-9, atol=1e-10)
        assert_allclose(found.information[group], information, rtol=1e-9, atol=1e-10)
        own = rows.group == group
        raw = np.einsum("rij,ri->j", modes.by_strengths[own] ** 2, modes.curvature[own])
        raw -= np.sum(np.einsum("rij,ri->rj", modes.by_strengths[own], modes.shared[own]) ** 2, axis=0)
        assert_allclose(found.raw[group], raw)
        assert np.all(np.diag(information) <= raw)


@pytest.mark.parametrize("n_free", [1, 2])
def test_what_is_in_already_takes_its_share(n_free: int) -> None:
    inputs = random_inputs(2, 2, seed=5)
    found = efficient_scores(*inputs, np.zeros(n_free))
    for group in range(2):
        score, information = dense(*inputs, group, n_free)
        assert_allclose(found.score[group], score, rtol=1e-7, atol=1e-9)
        assert_allclose(found.information[group], information, rtol=1e-7, atol=1e-9)


def test_units_of_what_is_in_already_do_not_matter() -> None:
    modes, *others = random_inputs(2, 2, seed=5)
    in_units = modes._replace(by_strengths=modes.by_strengths * np.array([1e8, 1.0, 1.0]))
    found, expected = (efficient_scores(one, *others, np.zeros(2)) for one in (in_units, modes))
    assert_allclose(found.score, expected.score, rtol=1e-9)
    assert_allclose(found.information, expected.information, rtol=1e-9)


def test_score_of_the_mean_itself_is_nil() -> None:
    """A direction that acts like the population's mean has hardly any information left with a wide prior."""
    modes, rows, population, prior = random_inputs(2, 1, seed=8)
    modes = modes._replace(by_strengths=modes.by_points[:, :, :1].copy())
    found = efficient_scores(modes, rows, population, prior._replace(sd=np.full(2, 1e4)))
    assert found.own[0, 0] < 1e-6 * found.raw[0, 0] and abs(found.score[0, 0]) < 1e-6


def test_population_of_simulated_campaigns_is_recovered() -> None:
    """Twelve campaigns of one population, begun far from it: means and spreads of what was drawn."""
    base = sparse_base()
    extension, n_groups = extended(base.problem, base.law), 12
    mean, spread = base.population.mean[0] + 0.05, 0.22
    means, factors = np.tile(mean, (n_groups, 1)), np.full((n_groups, 1, 1), spread)
    rows, true = bootstrap_campaigns(extension, np.zeros(0), means, factors, np.random.default_rng(1))
    far = Population(means - 0.3, np.full((n_groups, 1, 1), 0.3**2))
    start = np.column_stack([np.tile(mean - 0.3, (len(true), 1)), np.zeros(len(true))])
    found, points = fit_population(
        EventLikelihood(extension, rows, np.zeros(0)), mean_prior(base.law), (far, start)
    )
    # Readings tell an event's friction to a few per cent, so the mean's error is that of the draws.
    drawn = true[:, 0].reshape(n_groups, -1)
    n = drawn.shape[1]
    z = (found.mean[:, 0] - mean) / (spread / np.sqrt(n))
    assert np.abs(z).max() < 3.5 and abs(z.mean()) < 3.0 / np.sqrt(n_groups)
    assert_allclose(found.mean[:, 0], drawn.mean(axis=1), atol=0.5 * spread / np.sqrt(n))
    # Their prior (median 0.13) draws spreads in by 3 %; most probable ones are low by another 3 %.
    low = np.log(np.sqrt(found.covariance[:, 0, 0]) / drawn.std(axis=1, ddof=1))
    assert -0.15 < low.mean() < 0.03
    assert np.corrcoef(points[:, 0], true[:, 0])[0, 1] > 0.95


def test_scores_of_many_groups_are_those_of_each_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many of them are in memory together."""
    base = sparse_base()
    score_test, n = ScoreTest(base), len(base.rows.event)
    rows, points = base.rows.repeated(5), np.tile(base.fit.points, (5, 1))
    points[:, 0] += np.repeat([-0.02, -0.01, 0.0, 0.01, 0.02], n)
    population = Population(*(np.repeat(values, 5, axis=0) for values in base.population))
    at_once = score_test.scores(rows, points, population)
    assert at_once.score.shape[0] == 5 and np.ptp(at_once.score[:, 0]) > 0.0
    monkeypatch.setattr("skred.diagnosis.detect.score_test.MOST_NODES", 2 * n * at_once.score.shape[1])
    in_blocks = score_test.scores(rows, points, population)
    for k in range(5):
        alone = score_test.scores(base.rows, points[k * n : (k + 1) * n], base.population)
        for found in (at_once, in_blocks):
            for values, own in zip(found, alone, strict=True):
                assert_allclose(values[k], own[0], rtol=1e-9, atol=1e-9)


def test_order_of_events_does_not_matter() -> None:
    base = sparse_base()
    score_test = ScoreTest(base)
    order = np.random.default_rng(2).permutation(len(base.rows.event))
    turned = base.rows._replace(event=base.rows.event[order], readings=base.rows.readings.take(order))
    found = []
    for rows, points in ((base.rows, base.fit.points), (turned, base.fit.points[order])):
        likelihood = EventLikelihood(base.extended(), rows, np.zeros(0))
        population, modes = fit_population(likelihood, score_test.prior, (base.population, points))
        found.append(score_test.by_id(score_test.scores(rows, modes, population)))
    for name, one in found[0].items():
        assert_allclose(found[1][name].log_factors, one.log_factors, atol=1e-6)


def test_fitted_population_is_that_of_the_evidence() -> None:
    """Expectation-maximisation around modes against the top of the integrated likelihood."""
    base = sparse_base()
    start = (base.population, base.fit.points)
    likelihood = EventLikelihood(extended(base.problem, base.law), base.rows, np.zeros(0))
    found, _ = fit_population(likelihood, mean_prior(base.law), start)
    sd = np.sqrt(np.diag(base.fit.found.covariance))
    assert abs(found.mean[0, 0] - base.fit.found.psi[0]) < 0.3 * sd[0]
    assert abs(0.5 * np.log(found.covariance[0, 0, 0]) - base.fit.found.psi[1]) < 0.5 * sd[1]
