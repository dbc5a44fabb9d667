"""Surfaces against brute force: the kernel on a regular grid, an event at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from skred.campaign import Campaign, Event, Sensor, Status, find_campaign, read_campaign
from skred.inference.hierarchical.bisection import RELEASE_REACH, Resolution
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.hierarchical.surface import Surfaces
from skred.inference.reading_density import log_likelihoods
from skred.physics.kernel.fronts import simulate
from skred.physics.laws import load_law

CAMPAIGN = read_campaign(find_campaign("ryggfonn"))
FOUR = ["19831031", "19920311", "19970417", "20000217"]
"""Only a runout; a speed of 0 and two gates not reached; stopped at the dam's place; the farthest."""
TOLERANCE = 0.05
"""In nats, of an event's log density."""


def pick(ids: Sequence[str], **changes: Any) -> Campaign:
    """Some avalanches of Ryggfonn, their releases changed."""
    rows = [CAMPAIGN.event_ids.index(name) for name in ids]
    return replace(
        CAMPAIGN,
        events=tuple(replace(CAMPAIGN.events[row], **changes) for row in rows),
        values=CAMPAIGN.values[rows],
        status=CAMPAIGN.status[rows],
        stated_sd=CAMPAIGN.stated_sd[rows],
    )


class Population:
    """Mean and covariance of the logarithms of the strengths."""

    def __init__(self, mean: Sequence[float], sd: Sequence[float], correlation: float = 0.0) -> None:
        self.mean, n = np.array(mean), len(mean)
        matrix = np.full((n, n), correlation) + (1 - correlation) * np.eye(n)
        self.covariance = matrix * np.outer(sd, sd)

    def log_density(self, axes: Sequence[np.ndarray]) -> np.ndarray:
        """On a grid, from axes that broadcast."""
        precision = np.linalg.inv(self.covariance)
        result = np.array(-0.5 * np.log(np.linalg.det(2 * np.pi * self.covariance)))
        for i, j in product(range(len(axes)), repeat=2):
            result = result - 0.5 * precision[i, j] * (axes[i] - self.mean[i]) * (axes[j] - self.mean[j])
        return result


def populations(mean: Sequence[float], sd: Sequence[float]) -> list[Population]:
    """Around one: shifted, narrower and wider, with and without correlation."""
    centre, spread = np.array(mean), np.array(sd)
    shifts = [(0.0, 0.0), (0.6, -0.6), (-0.6, 0.6)]
    shapes = [(0.25, 0.0), (1.0, -0.6), (1.0, 0.5), (3.0, 0.0)]
    return [
        Population(centre + spread * np.array(shift[: len(centre)]), math.sqrt(factor) * spread, r)
        for shift, (factor, r) in product(shifts, shapes)
    ]


class Grid:
    """An event's likelihood on a regular grid of its strengths, the release integrated out."""

    def __init__(
        self, problem: HierarchicalProblem, law_id: str, event: int, box: np.ndarray, n: int, n_releases: int
    ) -> None:
        self.box, self.cell = box, (box[:, 1] - box[:, 0]) / n
        axes = [low + (np.arange(n) + 0.5) * cell for (low, _), cell in zip(box, self.cell, strict=True)]
        self.axes = np.meshgrid(*axes, indexing="ij", sparse=True)
        points = np.exp(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)))
        fronts, which = problem.fronts(load_law(law_id).mechanisms), np.full(len(points), event)
        total = np.full(len(points), -np.inf)
        ends = float(problem.terrain.edge_s_m[0]), problem.terrain.length_m
        for place, share in releases(problem.campaign.events[event], ends, n_releases):
            runs = simulate(points, np.full(len(points), place), fronts.path, fronts.law, fronts.sensors)
            log_l = log_likelihoods(which, runs, fronts.readings, fronts.errors)
            total = np.logaddexp(total, np.log(share) + log_l)
        self.log_likelihood = total.reshape((n,) * len(axes))

    def integral(self, population: Population, every: int = 1) -> float:
        """Log of the integral, from every second point with `every` = 2."""
        exponent = self.log_likelihood + population.log_density(self.axes)
        exponent = exponent[(slice(None, None, every),) * len(self.axes)]
        largest = exponent.max()
        return float(largest + np.log(np.exp(exponent - largest).sum()) + np.log(every * self.cell).sum())

    def where_it_matters(self, candidates: Sequence[Population]) -> np.ndarray:
        """Box around all but e^-30 of what any of the populations has."""
        exponent = self.log_likelihood + np.max([p.log_density(self.axes) for p in candidates], axis=0)
        at = np.array(np.nonzero(exponent > exponent.max() - 30.0))
        reach = np.column_stack([at.min(axis=1) - 1, at.max(axis=1) + 2])
        return np.asarray(self.box[:, :1] + reach * self.cell[:, None])


def releases(event: Event, ends_m: tuple[float, float], n: int) -> list[tuple[float, float]]:
    """Places and their probabilities: midpoints of a normal distribution cut off where the terrain ends."""
    if not event.release_sd_m:
        return [(event.release_s_m, 1.0)]
    mean, sd = event.release_s_m, event.release_sd_m
    edges = np.linspace(max(ends_m[0], mean - 5 * sd), min(ends_m[1], mean + 5 * sd), n + 1)
    shares = np.diff(norm.cdf(edges, mean, sd))
    return list(zip(0.5 * (edges[1:] + edges[:-1]), shares / shares.sum(), strict=True))


def brute_force(
    problem: HierarchicalProblem, law_id: str, candidates: Sequence[Population], n: int, n_releases: int = 1
) -> np.ndarray:
    """Log density of each event for each population, (n_populations, n_events).

    The grid of an event begins six standard deviations around all populations and is shrunk to
    where there is anything.
    """
    sd = np.sqrt([np.diag(p.covariance) for p in candidates])
    means = np.array([p.mean for p in candidates])
    result = np.empty((len(candidates), problem.campaign.n_events))
    for event in range(problem.campaign.n_events):
        box = np.array([(means - 6 * sd).min(axis=0), (means + 6 * sd).max(axis=0)]).T
        for _ in range(4):
            grid = Grid(problem, law_id, event, box, n, n_releases)
            box = grid.where_it_matters(candidates)
            if np.all(np.diff(box) > 0.6 * np.diff(grid.box)):
                break
        for k, population in enumerate(candidates):
            result[k, event] = grid.integral(population)
            assert abs(grid.integral(population, every=2) - result[k, event]) < 0.04, "the grid is too coarse"
    return result


def from_surfaces(surfaces: Surfaces, candidates: Sequence[Population]) -> np.ndarray:
    n_events = len(surfaces.first) - 1
    return np.array(
        [
            integrated_log_density(
                np.tile(p.mean, (n_events, 1)), np.linalg.cholesky(p.covariance), *surfaces.nodes
            )
            for p in candidates
        ]
    )


def differences(
    problem: HierarchicalProblem,
    law_id: str,
    around: tuple[list[float], list[float]],
    n: int,
    n_releases: int = 1,
) -> np.ndarray:
    """Of the populations that the recordings do not exclude: surfaces are resolved for no others."""
    candidates = populations(*around)
    exact = brute_force(problem, law_id, candidates, n, n_releases)
    found = from_surfaces(problem.surfaces(load_law(law_id).mechanisms), candidates)
    kept = exact.sum(axis=1) > exact.sum(axis=1).max() - 6.0
    assert kept.sum() >= 6
    return np.asarray(found - exact)[kept]


AROUND = {
    "coulomb": ([-0.66], [0.1]),
    "constant": ([1.54], [0.08]),
    "pcm": ([-1.12, -6.43], [0.35, 0.16]),
    "voellmy": ([-1.0, -6.4], [0.35, 0.16]),
}
"""Plausible for the four avalanches."""


@pytest.mark.parametrize(
    "law_id, errors",
    [
        ("coulomb", "robust"),
        ("constant", "student"),
        ("coulomb", "normal"),
        ("coulomb", "correlated"),
        ("constant", "scaled"),
    ],
)
def test_laws_of_one_strength(law_id: str, errors: str) -> None:
    problem = hierarchical_problem(pick(FOUR), error_model=errors)
    assert np.abs(differences(problem, law_id, AROUND[law_id], 40_000)).max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("law_id, errors", [("pcm", "robust"), ("pcm", "student"), ("voellmy", "robust")])
def test_laws_of_two_strengths(law_id: str, errors: str) -> None:
    problem = hierarchical_problem(pick(FOUR), error_model=errors)
    assert np.abs(differences(problem, law_id, AROUND[law_id], 450)).max() < TOLERANCE


def test_uncertain_releases_of_a_law_of_one_strength() -> None:
    """Cut off where the track begins, 2.7 standard deviations above: nothing that a box ends at."""
    campaign = pick(["19831031", "19970417", "20000217"], release_s_m=40.0, release_sd_m=15.0)
    problem = hierarchical_problem(campaign)
    assert np.abs(differences(problem, "coulomb", AROUND["coulomb"], 2000, 60)).max() < TOLERANCE


@pytest.mark.slow
def test_uncertain_releases_of_a_law_of_two_strengths() -> None:
    campaign = pick(["19970417"], release_s_m=40.0, release_sd_m=15.0)
    problem = hierarchical_problem(campaign)
    assert np.abs(differences(problem, "pcm", AROUND["pcm"], 400, 24)).max() < TOLERANCE


def test_a_release_matters() -> None:
    """A tenth of the fall height away: densities must differ, or the tests above would show nothing."""
    known = hierarchical_problem(pick(["19970417"], release_s_m=40.0))
    uncertain = hierarchical_problem(pick(["19970417"], release_s_m=40.0, release_sd_m=150.0))
    mechanisms = load_law("coulomb").mechanisms
    candidates = [Population([-0.65], [0.02])]
    one, other = (from_surfaces(p.surfaces(mechanisms), candidates)[0, 0] for p in (known, uncertain))
    assert abs(one - other) > 0.05


def two_nodes(width: float, information: float) -> float:
    """Log of two nodes a box over the exact integral of the release's prior times a centred likelihood."""
    low = -RELEASE_REACH + width * np.arange(round(2 * RELEASE_REACH / width))
    nodes = np.concatenate([low + width * (0.5 + side / math.sqrt(12.0)) for side in (-1.0, 1.0)])
    sd = 1.0 / math.sqrt(1.0 + information)
    exact = sd * math.sqrt(2.0 * math.pi) * (1.0 - 2.0 * norm.sf(RELEASE_REACH / sd))
    return math.log(0.5 * width * float(np.exp(-0.5 * (nodes / sd) ** 2).sum()) / exact)


def test_boxes_of_a_release_are_narrow_enough() -> None:
    usual, finer = Resolution().release, Resolution().finer().release
    assert abs(two_nodes(usual, 0.0)) < 2e-5 and abs(two_nodes(usual, 1.0)) < 2.5e-3
    assert 0.02 < abs(two_nodes(usual, 3.0)) < 0.04 and abs(two_nodes(finer, 3.0)) < 4e-3


@pytest.mark.parametrize("release", [0.0, 40.0])
def test_releases_that_begin_off_the_track(release: float) -> None:
    """With 19920311, which hardly moved: any release and much friction explain it."""
    campaign = pick(FOUR[:3], release_s_m=release, release_sd_m=20.0)
    problem = hierarchical_problem(campaign)
    assert np.abs(differences(problem, "coulomb", AROUND["coulomb"], 2000, 60)).max() < TOLERANCE


@pytest.mark.parametrize("release, release_sd, runout", [(60.0, 30.0, 200.0), (300.0, 60.0, 700.0)])
def test_a_release_beside_a_bench(release: float, release_sd: float, runout: float) -> None:
    """A short runout: released a little higher, the same snow does not start at all.

    All of its likelihood lies along that jump, which no halving resolves.
    """
    campaign = pick(FOUR[:1], release_s_m=release, release_sd_m=release_sd)
    problem = hierarchical_problem(replace(campaign, values=np.where(campaign.values > 0.0, runout, np.nan)))
    assert np.abs(differences(problem, "coulomb", ([-0.4], [0.1]), 2000, 400)).max() < TOLERANCE
    assert problem.surfaces(load_law("coulomb").mechanisms).n_runs < 500_000


PLAUSIBLE = Population([math.log(0.31), math.log(0.0035)], [0.22, 1.1], -0.1)
"""Within the posterior of all 22 avalanches."""


@pytest.mark.parametrize("errors", ["robust", "normal"])
def test_strengths_far_above_their_prior_scale(errors: str) -> None:
    """Slow avalanches have a drag ten times the usual: not to be cut off."""
    problem = hierarchical_problem(CAMPAIGN, error_model=errors)
    found = from_surfaces(problem.surfaces(load_law("pcm").mechanisms), [PLAUSIBLE])[0]
    slow = ["19880315", "19920311", "20030406"]
    exact = brute_force(hierarchical_problem(pick(slow), error_model=errors), "pcm", [PLAUSIBLE], 400)[0]
    assert np.abs(found[[CAMPAIGN.event_ids.index(name) for name in slow]] - exact).max() < TOLERANCE


def with_sensors(sensors: Sequence[Sensor], strengths: Sequence[Sequence[float]], noise: float) -> Campaign:
    """Avalanches of M2 recorded by some gates, and their runouts, with a relative error."""
    ryggfonn = hierarchical_problem(CAMPAIGN)
    table = np.array([(0.0, s.s_from_m, s.s_to_m) for s in sensors] + [(1.0, 0.0, 0.0)])
    law = ryggfonn.contributions(load_law("pcm").mechanisms)
    truth = simulate(np.array(strengths), np.zeros(len(strengths)), ryggfonn.path, law, table)
    rng = np.random.default_rng(4)
    status = np.full(truth.shape, Status.OBSERVED)
    status[:, :-1][truth[:, :-1] <= 0.0] = Status.NOT_REACHED
    values = truth * (1.0 + noise * rng.standard_normal(truth.shape))
    values[:, -1] = truth[:, -1] + 12.0 * rng.standard_normal(len(truth))
    return replace(
        CAMPAIGN,
        sensors=(*sensors, CAMPAIGN.sensors[-1]),
        events=tuple(replace(CAMPAIGN.events[0], id=f"e{k}") for k in range(len(truth))),
        values=np.where(status == Status.OBSERVED, values, np.nan),
        status=status,
        stated_sd=np.full(truth.shape, np.nan),
    )


TRUTH = [[0.28, 0.0022], [0.33, 0.0028], [0.24, 0.0035]]


def gates(n: int, length_m: float, relative_sd: float) -> list[Sensor]:
    starts = np.linspace(600.0, 1950.0 - length_m, n)
    return [
        Sensor(f"g{k}", "front_velocity", float(at), float(at + length_m), relative_sd, 0.1)
        for k, at in enumerate(starts)
    ]


def test_many_readings() -> None:
    """40 gates: a likelihood a hundredth as wide as the population."""
    campaign = with_sensors(gates(40, 0.0, 0.05), TRUTH, 0.05)
    assert np.sum(campaign.status == Status.OBSERVED) > 110
    problem = hierarchical_problem(campaign)
    around = ([-1.25, -5.9], [0.15, 0.2])
    assert np.abs(differences(problem, "pcm", around, 300)).max() < TOLERANCE


def test_how_little_drag_there_is_stays_open() -> None:
    """Recordings of fronts without drag: a tenth of next to none is as likely, however little that is."""
    law = load_law("pcm")
    strengths = [[friction, 1e-9] for friction in (0.31, 0.34, 0.36, 0.39, 0.42, 0.45)]
    problem = hierarchical_problem(with_sensors(gates(8, 0.0, 0.05), strengths, 0.05))
    scale = law.mechanisms[1].strength.prior_scale
    drag = scale * np.exp([-7.0, -8.0, -9.0])
    samples = {"dry_friction": [0.38] * 3, "turbulent_drag": drag, "dry_friction_spread": [0.12] * 3}
    samples |= {"turbulent_drag_spread": [0.2] * 3, "dry_friction_turbulent_drag_correlation": [0.0] * 3}
    samples = {name: np.array(values) for name, values in samples.items()}
    found = problem.log_likelihood(law, samples).sum(axis=1)
    assert abs(found[0] - found[1]) < 0.5 and abs(found[1] - found[2]) < 0.1
    assert np.abs(problem.integration_errors(law, samples)).max() < TOLERANCE


def test_spans() -> None:
    """Mean speeds over 120 m, read up to the stop of a front that stops inside one."""
    campaign = with_sensors(gates(8, 120.0, 0.1), TRUTH, 0.1)
    problem = hierarchical_problem(campaign)
    around = ([-1.25, -5.9], [0.15, 0.2])
    assert np.abs(differences(problem, "pcm", around, 300)).max() < TOLERANCE
    stop = float(problem.readings.reached.max())
    assert stop == campaign.sensors[7].s_to_m or stop in [sensor.s_to_m for sensor in campaign.sensors[:8]]


def test_nodes_have_the_moments_of_their_patches() -> None:
    problem = hierarchical_problem(pick(FOUR))
    surfaces = problem.surfaces(load_law("pcm").mechanisms)
    first, points, log_weights, _ = surfaces.nodes
    assert np.all(np.diff(surfaces.first) > 0) and surfaces.first[-1] == surfaces.n_patches
    assert_allclose(first, 4 * surfaces.first)
    points = points.T.reshape(-1, 4, 2)
    weights = np.exp(log_weights.reshape(-1, 4) - surfaces.log_weights[:, None])
    assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
    mean = np.einsum("kn,kni->ki", weights, points)
    assert_allclose(mean, surfaces.mean[:, :2], rtol=1e-10)
    deviation = points - mean[:, None]
    moment = np.einsum("kn,kni,knj->kij", weights, deviation, deviation)
    assert_allclose(moment, surfaces.covariance[:, :2, :2], atol=1e-10)
    assert np.all(surfaces.mean[:, 2] == 0.0) and np.all(surfaces.covariance[:, 2] == 0.0)
