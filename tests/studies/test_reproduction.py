"""Pieces of the comparison with the paper: the bowl, retardations, and posteriors on a grid."""

import numpy as np
import pytest
from scipy.stats import halfnorm, norm, truncnorm

from skred.inference.pooled.problem import PooledProblem
from skred.physics.kernel.columns import GRAVITY
from skred.physics.terrain import build_terrain
from studies.reproduction.cases import (
    StatedErrorsProblem,
    baseline_case,
    complete,
    only_events,
    place_uncertainties,
)
from studies.reproduction.facts import (
    bisect,
    bowl_limit,
    drop,
    fit_means,
    mean_retardation,
    modelled_retardation,
    recorded_retardation,
    response,
    retardation_at,
    start_for_limit,
)
from studies.reproduction.quadrature import GridPosterior, grid_posterior
from studies.reproduction.statements import judge

LC = 0


@pytest.fixture(scope="module")
def case():
    return baseline_case()


@pytest.fixture(scope="module")
def problem(case) -> PooledProblem:
    return case.problem


def test_the_bowl_stops_m3_where_the_paper_says(case, problem):
    limit, readings = bowl_limit(problem, case.mechanisms("constant"), 9.0, 0.0)
    assert 4.6 < limit < 4.85
    assert readings[LC] == pytest.approx(30.0, rel=0.1)
    assert response(problem, case.mechanisms("constant"), [4.7], 0.0)[LC] == pytest.approx(30.0, rel=0.1)
    beyond = response(problem, case.mechanisms("constant"), [limit + 1e-4], 0.0)
    assert beyond[LC] == 0.0


def test_a_lower_start_lowers_the_limit(case, problem):
    mechanisms = case.mechanisms("constant")
    limits = [bowl_limit(problem, mechanisms, 9.0, start)[0] for start in (0.0, 50.0, 100.0)]
    assert limits == sorted(limits, reverse=True)
    start = start_for_limit(problem, mechanisms, limits[1])
    assert start == pytest.approx(50.0, abs=0.1)


def test_bisection_refuses_a_bracket_that_is_none():
    assert bisect(lambda x: x * x < 2.0, 0.0, 2.0) == pytest.approx(np.sqrt(2.0), abs=1e-6)
    with pytest.raises(ValueError, match="expected 2.0 to pass"):
        bisect(lambda x: x < 1.0, 2.0, 3.0)


def test_retardation_on_an_inclined_plane():
    slope, friction, length = np.radians(30.0), 0.3, 200.0
    x = np.linspace(0.0, 1000.0, 201)
    terrain = build_terrain(x, 1000.0 - np.tan(slope) * x)
    fall = drop(terrain, 100.0, 100.0 + length)
    assert fall == pytest.approx(length * np.sin(slope), rel=1e-6)
    retardation = -friction * GRAVITY * np.cos(slope)
    u_from = np.array([0.0, 20.0])
    u_to = np.sqrt(u_from**2 + 2.0 * length * (GRAVITY * np.sin(slope) + retardation))
    assert mean_retardation(u_from, u_to, length, fall) == pytest.approx([retardation] * 2, rel=1e-6)


def test_retardation_of_a_law_is_its_strength(case, problem):
    strengths = np.array([[4.5], [4.6]])
    values = modelled_retardation(problem, case.mechanisms("constant"), strengths, 1590.0, 1710.0)
    assert values == pytest.approx([-4.5, -4.6], abs=1e-9)


def test_retardation_of_m2_over_short_stretches_is_that_of_its_cells(case, problem):
    mechanisms, strengths = case.mechanisms("pcm"), np.array([[0.2, 3e-3]])
    edge = problem.terrain.edge_s_m
    i = int(np.searchsorted(edge, 1650.0)) - 1
    speed = problem.speeds(mechanisms, strengths, 0.0)[0]
    local = retardation_at(
        problem, 0.2, 3e-3, float(np.sqrt(0.5 * (speed[i] ** 2 + speed[i + 1] ** 2))), 1650.0
    )
    value = modelled_retardation(problem, mechanisms, strengths, edge[i], edge[i + 1])
    assert value[0] == pytest.approx(local, rel=1e-3)


def test_recorded_retardation_by_hand(problem):
    r = recorded_retardation(problem, "LC", "CD")
    by_hand = (35.0**2 - 50.0**2) / (2 * 160.0) - GRAVITY * r.drop_m / 160.0
    assert r.values[r.events.index("19750225")] == pytest.approx(by_hand, rel=1e-9)
    strong, weak, gap = r.groups()
    assert len(strong) + len(weak) == len(r.events)
    assert r.mean_of(strong) < r.mean_of(weak)
    assert min(r.values[[r.events.index(e) for e in weak]]) - gap == pytest.approx(
        max(r.values[[r.events.index(e) for e in strong]])
    )


def test_fit_recovers_strengths(case, problem):
    truth = np.array([[0.25, 2.5e-3]])
    targets = problem.simulate(case.mechanisms("pcm"), truth)[0, 0]
    strengths, _ = fit_means(
        problem, case.mechanisms("pcm"), targets, np.array([1.0, 1.0, 1.0, 0.01]), cells=81
    )
    assert strengths == pytest.approx(truth[0], rel=2e-3)


def test_grid_against_a_truncated_normal():
    scale, centre, sd = 2.0, 1.0, 0.3
    posterior = grid_posterior(lambda x: norm.logpdf(x[:, 0], centre, sd), [scale])
    variance = 1.0 / (1.0 / scale**2 + 1.0 / sd**2)
    mean = variance * centre / sd**2
    exact = truncnorm(-mean / np.sqrt(variance), np.inf, mean, np.sqrt(variance))
    evidence = 2.0 * norm.pdf(centre, 0.0, np.hypot(scale, sd)) * norm.cdf(mean / np.sqrt(variance))
    assert posterior.mean[0] == pytest.approx(exact.mean(), rel=1e-6)
    assert posterior.sd[0] == pytest.approx(exact.std(), rel=1e-5)
    assert posterior.log_evidence == pytest.approx(np.log(evidence), abs=1e-6)
    assert posterior.quantiles(0, [0.05, 0.95]) == pytest.approx(exact.ppf([0.05, 0.95]), rel=1e-4)
    assert len(posterior.modes) == 1


def test_grid_with_a_step_and_two_correlated_strengths():
    covariance = np.array([[0.04, -0.006], [-0.006, 0.0025]])
    precision = np.linalg.inv(covariance)

    def log_likelihood(x):
        d = x - [1.0, 0.5]
        return np.where(x[:, 0] < 1.1, -0.5 * np.einsum("ni,ij,nj->n", d, precision, d), -np.inf)

    posterior = grid_posterior(log_likelihood, [20.0, 20.0])
    first = truncnorm(-np.inf, 0.5, 1.0, 0.2)
    assert posterior.mean[0] == pytest.approx(first.mean(), abs=1e-3)
    assert posterior.sd[0] == pytest.approx(first.std(), rel=5e-3)
    expected = 0.5 - 0.006 / 0.04 * (first.mean() - 1.0)
    assert posterior.mean[1] == pytest.approx(expected, abs=1e-3)
    assert posterior.bend == pytest.approx(0.0, abs=2e-3)
    assert len(posterior.modes) == 1


def test_grid_says_when_it_sees_nothing():
    with pytest.raises(ValueError, match="vanishes on the whole search grid"):
        grid_posterior(lambda x: np.full(len(x), -np.inf), [1.0])


def test_grid_finds_two_modes():
    def log_likelihood(x):
        return np.logaddexp(norm.logpdf(x[:, 0], 1.0, 0.1), np.log(0.5) + norm.logpdf(x[:, 0], 2.0, 0.1))

    modes = grid_posterior(log_likelihood, [50.0]).modes
    assert [float(place[0]) for place, _ in modes] == pytest.approx([1.0, 2.0], abs=0.01)
    assert modes[1][1] == pytest.approx(0.5, abs=0.02)


def test_bend_sees_a_parabola():
    u = np.linspace(-3.0, 3.0, 201)
    density = norm.pdf(u)[:, None] * norm.pdf(u[None, :], 0.5 * (u[:, None] ** 2 - 1.0), 0.3)
    posterior = GridPosterior((u, u), density / density.sum(), 0.0)
    assert posterior.correlation == pytest.approx(0.0, abs=1e-6)
    assert posterior.bend > 0.7


def test_grid_evidence_against_plain_monte_carlo(case, problem):
    """M3's evidence: an average of the likelihood over the prior, within its own error."""
    mechanisms = case.mechanisms("constant")
    scale = mechanisms[0].strength.prior_scale

    def log_likelihood(x):
        return problem.log_density(mechanisms, x).sum(axis=1)

    grid = grid_posterior(log_likelihood, [scale])
    draws = halfnorm(scale=scale).rvs(40_000, random_state=np.random.default_rng(1))
    relative = np.exp(log_likelihood(draws[:, None]) - grid.log_evidence)
    assert relative.mean() == pytest.approx(1.0, abs=4.0 * relative.std() / np.sqrt(len(draws)))


def test_stated_errors_give_each_event_its_own(problem):
    stated = StatedErrorsProblem(problem.campaign, problem.terrain, problem.covariance, problem.recorded_mean)
    full = int(np.flatnonzero(complete(problem))[0])
    sd = problem.campaign.reading_sd()[full]
    assert np.diag(stated.arrays.whiten[full]) == pytest.approx(1.0 / sd)
    assert stated.arrays.constant[full] == pytest.approx(norm.logpdf(0.0, 0.0, sd).sum())


def test_alternatives_change_what_they_say(problem):
    few = only_events(problem.campaign, complete(problem), "few")
    assert few.n_events == complete(problem).sum() < problem.campaign.n_events
    assert np.isfinite(few.values).all()


def test_stated_uncertainties_of_the_places():
    from skred.campaign import find_campaign

    raw = find_campaign("ryggfonn") / "raw"
    assert place_uncertainties(raw) == {"LC": 40.0, "CD": 20.0, "b": 5.0}


def test_verdicts():
    assert judge(0.2, 0.25, 0.03, (0.19, 0.3)) == "reproduced"
    assert judge(4.7, 4.8, 0.0).startswith("reproduced to 2.1 %")
    assert judge(0.47, 0.53, 0.002, (0.52, 0.54)) == "differs by +0.06 (13 %, 30.0 of our posterior sd)"
