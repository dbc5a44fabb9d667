"""Fronts that do not start from rest: the speed is in every likelihood, its error an unknown."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from skred.campaign import Campaign, Event, Sensor, Status, Track
from skred.diagnosis.evidence.extension import extended
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.event_draws import fronts_of, new_avalanches
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.pooled.problem import pooled_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Direction
from skred.physics.reference import read_front

COULOMB = load_law("coulomb")
MEDIAN, SLOPE = 0.2, np.radians(5.0)
PLACES = (80.0, 140.0)
RELEASES = ((20.0, 24.0), (20.0, 19.0), (60.0, 24.0), (5.0, 0.0))


@cache
def rolling(sd_m: float | None = None, speed_sd: float | None = None, n_events: int = 12) -> Campaign:
    """Bodies on a slope of 5 degrees with friction of about 0.2, read at two places and where they stop."""
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 1500.0, 151)
    events, values = [], []
    for k in range(n_events):
        place, speed = RELEASES[k % len(RELEASES) if k < 4 else k % 3]
        mu = MEDIAN * np.exp(0.1 * rng.standard_normal())
        pull = 9.81 * (np.sin(SLOPE) - mu * np.cos(SLOPE))
        events.append(Event(f"{k}", place, sd_m, {}, speed or None, speed_sd if speed else None))
        squares = [speed**2 + 2.0 * pull * (s - place) for s in PLACES]
        stop = place + speed**2 / (-2.0 * pull)
        values.append([*(np.sqrt(max(square, 0.0)) for square in squares), stop])
    values = np.array(values) + np.array([0.3, 0.3, 4.0]) * rng.standard_normal((n_events, 3))
    sensors = (
        *(Sensor(f"s{s:.0f}", "front_velocity", s, s, 0.05, 0.3) for s in PLACES),
        Sensor("stop", "runout", np.nan, np.nan, 0.0, 6.0),
    )
    status = np.full(values.shape, int(Status.OBSERVED), dtype=np.int8)
    values[:, :2] = np.where(values[:, :2] > 1.5, values[:, :2], 0.0)
    return Campaign(
        "rolling", "", "", "simulated", None, Track(x, np.tan(SLOPE) * (1500.0 - x)), sensors,
        tuple(events), values, status, np.full(values.shape, np.nan),
    )  # fmt: skip


def problem_of(**uncertain: float) -> HierarchicalProblem:
    return replace(hierarchical_problem(rolling(**uncertain)), error_model=ERROR_MODELS["normal"])


def reference_readings(problem: HierarchicalProblem, place: float, speed: float, mu: float) -> np.ndarray:
    table = np.zeros((5, problem.terrain.n_cells))
    table[3] = mu
    sensors = [*(("point", s, s) for s in PLACES), ("runout", 0.0, 0.0)]
    return read_front(problem.terrain, table, place, sensors, release_speed=speed)


def by_quadrature(problem: HierarchicalProblem, event: int, median: float, spread: float) -> float:
    """Log likelihood of an event by nested quadrature over the reference's fronts."""
    one, values = problem.campaign.events[event], problem.values[event]
    sd = 0.0 if one.release_speed_sd_m_s is None else one.release_speed_sd_m_s

    def density(log_mu: float, deviation: float) -> float:
        speed = (one.release_speed_m_s or 0.0) + sd * deviation
        found = reference_readings(problem, one.release_s_m, speed, float(np.exp(log_mu)))
        errors = np.hypot([0.05 * found[0], 0.05 * found[1], 0.0], [0.3, 0.3, 6.0])
        reached = values[:2] > 0.0
        place = PLACES[int(reached.sum()) - 1] if reached.any() else -np.inf
        return float(
            np.prod(norm.pdf(values, found, errors))
            * norm.cdf((found[2] - place) / problem.place_sd_m)
            * norm.pdf(log_mu, np.log(median), spread)
        )

    def inner(deviation: float) -> float:
        ends = np.log(median) + spread * np.array([-5.0, 5.0])
        nodes = np.linspace(*ends, 400)
        rows = np.array([density(node, deviation) for node in nodes])
        return float(np.trapezoid(rows, nodes))

    if sd == 0.0:
        return float(np.log(inner(0.0)))
    return float(np.log(quad(lambda z: inner(z) * norm.pdf(z), -5.0, 5.0, epsrel=1e-5, limit=60)[0]))


@pytest.mark.parametrize("speed_sd", [None, pytest.param(0.8, marks=pytest.mark.slow)])
def test_the_hierarchical_likelihood_is_that_of_the_references_fronts(speed_sd: float | None) -> None:
    problem = problem_of(speed_sd=speed_sd) if speed_sd else problem_of()
    samples = {"dry_friction": [MEDIAN], "dry_friction_spread": [0.1]}
    found = problem.log_likelihood(COULOMB, samples)[0]
    for event in (0, 1) if speed_sd else (0, 1, 2):
        assert_allclose(found[event], by_quadrature(problem, event, MEDIAN, 0.1), atol=0.01)


def test_the_pooled_likelihood_starts_each_event_with_its_own_speed() -> None:
    problem = pooled_problem(rolling())
    assert len(problem.releases) == len(RELEASES)
    assert problem.release_speeds[problem.release_of_event].tolist() == [
        event.release_speed_m_s or 0.0 for event in problem.campaign.events
    ]
    found = problem.log_density(COULOMB.mechanisms, np.array([[MEDIAN]]))[0]
    hierarchical = problem_of()
    for k, event in enumerate(problem.campaign.events):
        front = reference_readings(hierarchical, event.release_s_m, event.release_speed_m_s or 0.0, MEDIAN)
        expected = multivariate_normal.logpdf(problem.values[k], front, problem.covariance)
        assert_allclose(found[k], expected, rtol=1e-9)


@pytest.mark.parametrize("uncertain", [{}, {"sd_m": 3.0}, {"speed_sd": 0.8}], ids=str)
def test_tangents_of_the_diagnosis_are_the_derivatives(uncertain: dict[str, float]) -> None:
    problem = problem_of(**uncertain)
    drag = Direction((2,), np.ones((1, problem.terrain.n_cells)))
    extension = extended(problem, COULOMB, [drag, Direction(release=1.0)])
    events = np.array([0, 1, 2, 5])
    points = np.column_stack([np.log([0.19, 0.2, 0.21, 0.2]), [0.3, -0.5, 0.2, 0.0]])
    strengths = np.tile([2e-4, 1.5], (4, 1))
    readings, by_points, by_strengths = extension.tangents(events, points, strengths)
    assert_allclose(readings, extension.predict(events, points, strengths))
    for axis, (given, step) in enumerate(
        ((points, 1e-6), (points, 1e-6), (strengths, 1e-9), (strengths, 1e-5))
    ):
        change = np.zeros(2)
        change[axis % 2] = step
        sides = [
            extension.predict(
                events, *((given + sign * change, strengths) if axis < 2 else (points, given + sign * change))
            )
            for sign in (1.0, -1.0)
        ]
        numeric = (sides[0] - sides[1]) / (2.0 * step)
        found = (by_points if axis < 2 else by_strengths)[:, :, axis % 2]
        assert_allclose(found, numeric, rtol=2e-5, atol=1e-6 * np.abs(numeric).max())
    certain = not uncertain
    assert (np.abs(by_points[:3, :, 1]).max() == 0.0) == certain


def test_new_avalanches_start_as_the_recorded_ones() -> None:
    problem = problem_of(speed_sd=0.8)
    samples = {"dry_friction": np.full(4000, MEDIAN), "dry_friction_spread": np.full(4000, 0.1)}
    drawn = new_avalanches(problem, COULOMB, samples, np.random.default_rng(1))
    speeds = np.array([event.release_speed_m_s or 0.0 for event in problem.campaign.events])
    assert_allclose(drawn.release_speeds.mean(axis=0), speeds, atol=0.06)
    assert_allclose(drawn.release_speeds.std(axis=0)[:3], 0.8, atol=0.04)
    assert drawn.release_speeds[:, 3].max() == 0.0
    fronts = fronts_of(problem, COULOMB, drawn)
    one = reference_readings(
        problem, drawn.releases[7, 1], drawn.release_speeds[7, 1], drawn.strengths[7, 1, 0]
    )
    assert_allclose(fronts[7, 1, [0, 1, 2]], one, rtol=1e-10)


def test_where_place_and_speed_are_uncertain_the_place_counts() -> None:
    both = problem_of(sd_m=3.0, speed_sd=0.8)
    assert both.releases.sd.min() == 3.0 and both.releases.speed_sd.max() == 0.0
    samples = {"dry_friction": [MEDIAN], "dry_friction_spread": [0.1]}
    assert_allclose(
        both.log_likelihood(COULOMB, samples), problem_of(sd_m=3.0).log_likelihood(COULOMB, samples)
    )
