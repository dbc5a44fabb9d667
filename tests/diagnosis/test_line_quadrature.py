"""Nodes on a line against closed forms; `test_marginal` has them against surfaces, on recordings."""

import numpy as np
import pytest
from scipy.stats import norm

from skred.diagnosis.evidence.line_quadrature import line_nodes

MEAN, SD = np.array([1.5, -0.4]), np.array([0.04, 0.3])
OTHERS = 144
"""As many importance nodes as the comparison takes."""


def log_integrals(log_likelihood, others=OTHERS, mode=0.0):
    """Of likelihoods over two populations, by nodes on a line; the mode in standard deviations."""
    widths = np.column_stack([1.6 * SD, 1.6 * SD, 0.3 * SD])
    centres = np.column_stack([MEAN, MEAN + 0.5 * SD, MEAN + mode * SD])
    populations, shifts = (MEAN[:, None], SD[:, None]), np.zeros(2)
    points, log_weights = line_nodes(log_likelihood, centres, widths, populations, others, shifts)
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


def test_no_narrow_population_has_more_than_all_of_itself():
    """Avalanches that a strength does nothing for have the same likelihood, and much the same nodes.

    Around a narrow population far from the reference; at an edge of a gathering of nodes one stood for all
    of the gap beside it, a hundred nats for these avalanches.
    """
    n, own, reference = 22, -7.767, -0.62
    centres = np.tile([own, own, reference], (n, 1))
    widths = np.tile([1.35 * 0.0036, 1.6 * 0.0036, 1.6 * 0.022], (n, 1))
    populations = np.tile([own, reference], (n, 1)), np.tile([0.0036, 0.022], (n, 1))
    shifts = 0.5 * (0.618034 * np.arange(n) % 1.0) - 0.25
    points, log_weights = line_nodes(np.zeros_like, centres, widths, populations, OTHERS, shifts)
    means, sds = np.meshgrid(np.linspace(-8.2, -7.3, 451), [0.0036, 0.01, 0.03, 0.1, 0.3])
    for mean, sd in zip(means.ravel(), sds.ravel(), strict=True):
        of_each = np.logaddexp.reduce(log_weights + norm.logpdf(points, mean, sd), axis=1)
        assert of_each.sum() < 25.0


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
