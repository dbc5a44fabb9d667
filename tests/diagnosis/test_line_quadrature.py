"""Nodes on a line against closed forms; `test_marginal` has them against surfaces, on recordings."""

import numpy as np
import pytest
from scipy.stats import norm

from skred.diagnosis.evidence.event_quadrature import FINE, FIRST, USUAL, Spread
from skred.diagnosis.evidence.line_quadrature import line_nodes
from skred.diagnosis.evidence.population_target import NARROWEST, log_prior, log_targets
from skred.inference.hierarchical.rough_population import SPREAD_LOG_SD, SPREAD_MEDIAN

MEAN, SD = np.array([1.5, -0.4]), np.array([0.04, 0.3])
OTHERS = USUAL.total


def log_integrals(log_likelihood, others=OTHERS, mode=0.0):
    """Of likelihoods over two populations, by nodes on a line; the mode in standard deviations."""
    widths = np.column_stack([1.6 * SD, 1.6 * SD, 0.3 * SD])
    centres = np.column_stack([MEAN, MEAN + 0.5 * SD, MEAN + mode * SD])
    populations = MEAN[:, None], SD[:, None]
    points, log_weights, _ = line_nodes(log_likelihood, centres, widths, populations, others)
    assert np.all(np.diff(points, axis=1) >= 0.0)
    log_density = norm.logpdf(points, MEAN[:, None], SD[:, None])
    return np.logaddexp.reduce(log_weights + log_density, axis=1)


def standard(points):
    """Points in standard deviations of their populations."""
    return (points - MEAN[:, None]) / SD[:, None]


def test_recordings_that_say_nothing_leave_the_population_whole():
    assert log_integrals(lambda points: np.zeros_like(points)) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("width", [0.02, 0.3, 2.0])
@pytest.mark.parametrize("off", [-1.3, 0.0, 0.9])
def test_a_normal_likelihood_has_its_closed_form(width, off):
    found = log_integrals(lambda points: norm.logpdf(standard(points), off, width))
    assert found == pytest.approx(norm.logpdf(off, 0.0, np.hypot(1.0, width)), abs=0.02)


@pytest.mark.parametrize("edge", np.linspace(-1.7, 1.9, 9))
def test_a_jump_is_closed_in_on(edge):
    found = log_integrals(lambda points: np.where(standard(points) < edge, 0.0, -30.0))
    assert found == pytest.approx(norm.logcdf(edge), abs=0.03)


@pytest.mark.parametrize("edge", np.linspace(-0.9, 0.9, 7))
def test_a_spike_beside_an_edge_is_seen(edge):
    # A front that comes by only just: most of the evidence in a fiftieth of the population, at its mode.
    rate = 50.0

    def log_likelihood(points):
        below = edge - standard(points)
        return np.where(below >= 0.0, np.logaddexp(4.0 - rate * below, 0.0), -30.0)

    spike = 4.0 - rate * edge + 0.5 * rate**2 + norm.logcdf(edge - rate)
    exact = np.logaddexp(spike, norm.logcdf(edge))
    assert log_integrals(log_likelihood, mode=edge) == pytest.approx(exact, abs=0.1)


@pytest.mark.parametrize("budget", [FIRST, USUAL, FINE])
@pytest.mark.parametrize(("own", "spread"), [(-7.767, 0.0036), (-1.5, 0.0036), (-1.5, 0.05), (-3.0, 0.3)])
def test_what_a_strength_does_nothing_for_has_no_evidence_of_it(own, spread, budget):
    """Avalanches with one likelihood at every strength, and all their nodes at the same places.

    Most populations of the prior are between those: summed up, what they have of themselves there and what
    they have too much on others is tens of nats.
    """
    n, reference, wide, log_scale = 22, -0.62, 0.022, np.array([-0.69])
    centres = np.tile([own, own, reference], (n, 1))
    widths = np.tile([1.35 * spread, 1.6 * spread, 1.6 * wide], (n, 1))
    populations = np.tile([own, reference], (n, 1)), np.tile([spread, wide], (n, 1))
    points, *found = line_nodes(np.zeros_like, centres, widths, populations, budget.total)
    nodes = Spread(np.stack([points, np.zeros_like(points)], axis=2), *found).nodes
    rng = np.random.default_rng(0)
    mean = log_scale[0] + np.log(np.abs(rng.standard_normal(4000)))
    log_spread = np.log(SPREAD_MEDIAN) + SPREAD_LOG_SD * rng.standard_normal(4000)
    log_spread = np.maximum(log_spread, NARROWEST)
    psi = np.column_stack([mean, log_spread])
    log_l = log_targets(psi, 1, log_scale, *nodes) - [log_prior(one, 1, log_scale) for one in psi]
    assert log_l.max() < 1e-9
    assert -1.0 < np.logaddexp.reduce(log_l) - np.log(len(log_l))


@pytest.mark.parametrize("budget", [USUAL, FINE])
@pytest.mark.parametrize(
    ("n", "weaker"),
    [(22, 1.0), (22, 3.0), (22, 10.0), (60, 2.0), (100, 1.0), (100, 3.0), (100, 10.0), (200, 1.0)],
)
def test_recordings_that_say_little_have_the_evidence_of_a_closed_form(n, weaker, budget):
    """Normal likelihoods, so many times wider than the population that nodes are around.

    Populations may be narrower than the distance between nodes, which are at the same places for all: tens of
    nats too much if they may have more than all of themselves at them.
    """
    mean, spread, log_scale = -0.69, 0.3, np.array([-0.69])
    width = weaker * spread
    own = mean + np.hypot(width, spread) * np.random.default_rng(1).standard_normal(n)
    covariance = 1.0 / (width**-2 + spread**-2)
    most = covariance * (own / width**2 + mean / spread**2)
    centres = np.column_stack([most, np.full(n, mean)])
    widths = np.tile([budget.wider * np.sqrt(covariance), budget.population_wider * spread], (n, 1))
    populations = np.full((n, 1), mean), np.full((n, 1), spread)
    points, *found = line_nodes(
        lambda at: -0.5 * ((at - own[:, None]) / width) ** 2, centres, widths, populations, budget.total
    )
    nodes = Spread(np.stack([points, np.zeros_like(points)], axis=2), *found).nodes
    means, log_spreads = np.linspace(mean - 2.0, mean + 2.0, 101), np.linspace(NARROWEST, 0.5, 61)
    psi = np.stack(np.meshgrid(means, log_spreads), axis=-1).reshape(-1, 2)
    sds = np.hypot(width, np.exp(psi[:, 1:]))
    exact = norm.logpdf(own, psi[:, :1], sds).sum(axis=1) - n * norm.logpdf(0.0, 0.0, width)
    exact += [log_prior(one, 1, log_scale) for one in psi]
    summed = np.logaddexp.reduce(log_targets(psi, 1, log_scale, *nodes))
    assert summed == pytest.approx(np.logaddexp.reduce(exact), abs=0.3 + 0.003 * n)


def test_four_times_as_many_are_nearer():
    edges = np.linspace(-1.5, 1.5, 31)

    def worst(others):
        return max(
            np.abs(
                log_integrals(lambda points, e=edge: np.where(standard(points) < e, 0.0, -30.0), others)
                - norm.logcdf(edge)
            ).max()
            for edge in edges
        )

    assert worst(16 * OTHERS) < 0.3 * worst(OTHERS)
