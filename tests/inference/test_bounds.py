"""Readings known by bounds only: far tails, slopes, and every likelihood by another route."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numba import njit
from numpy.testing import assert_allclose
from scipy.special import log_ndtr
from scipy.stats import multivariate_normal, norm, t

from skred.campaign import Campaign, Event, Sensor, Status, Track
from skred.inference import bounds
from skred.inference.error_model import ERROR_MODELS, OUTLIER_FACTOR, event_readings
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.pooled.density import pooled_arrays, pooled_log_density, pooled_log_density_pullback
from skred.inference.pooled.problem import pooled_problem
from skred.inference.reading_density import log_likelihood_bounds, log_likelihoods
from skred.physics.laws import load_law

INF = np.inf
COULOMB = load_law("coulomb")
# As compiled code calls them.
_inside, _bound, _slopes = bounds.log_inside, bounds.log_bound, bounds.bound_slopes


@njit
def log_inside(low, high, student):  # type: ignore[no-untyped-def]
    return _inside(low, high, student)


@njit
def log_bound(low, high, share, student):  # type: ignore[no-untyped-def]
    return _bound(low, high, share, student)


@njit
def bound_slopes(low, high, share, d_sd, student):  # type: ignore[no-untyped-def]
    return _slopes(low, high, share, d_sd, student)


@pytest.mark.parametrize("z", [-1e6, -300.0, -37.6, -20.1, -19.9, -5.0, 0.0, 3.0, 9.0, 40.0])
def test_one_side_is_right_to_the_far_tail(z: float) -> None:
    assert_allclose(log_inside(-INF, z, False), log_ndtr(z), rtol=1e-10, atol=1e-300)
    assert_allclose(log_inside(-z, INF, False), log_ndtr(z), rtol=1e-10, atol=1e-300)
    if z > -1e5:
        assert_allclose(log_inside(-INF, z, True), t(4).logcdf(z), rtol=1e-7, atol=1e-15)


@pytest.mark.parametrize(
    ("low", "high"), [(-1.0, 2.0), (0.5, 0.6), (5.0, 7.0), (-60.0, -50.0), (30.0, 1e5), (8.0, 8.0 + 1e-9)]
)
def test_an_interval_is_right_in_either_tail(low: float, high: float) -> None:
    a, b = log_ndtr(-abs(low)) if low > 0 else log_ndtr(low), log_ndtr(-high) if low > 0 else log_ndtr(high)
    expected = max(a, b) + np.log(-np.expm1(-abs(a - b)))
    assert_allclose(log_inside(low, high, False), expected, rtol=1e-6)
    assert_allclose(log_inside(-high, -low, False), expected, rtol=1e-6)
    inside = t(4).cdf(high) - t(4).cdf(low)
    if inside > 1e-6:
        assert_allclose(log_inside(low, high, True), np.log(inside), rtol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.02])
@pytest.mark.parametrize("student", [False, True])
@pytest.mark.parametrize(
    ("low", "high"),
    [(1.0, INF), (-INF, -2.5), (-0.5, 1.5), (12.0, INF), (-INF, -300.0), (40.0, 45.0), (-80.0, INF)],
)
def test_slopes_of_a_bound_are_its_derivatives(low: float, high: float, share: float, student: bool) -> None:
    """By the prediction, on which the standard deviation depends; curvatures are never negative."""
    sd, d_sd, step = 2.0, 0.15, 1e-4

    def at(change: float) -> float:
        wide = sd + d_sd * change
        ends = (low * sd - change) / wide, (high * sd - change) / wide
        return log_bound(*ends, share, student)

    slope, curvature = bound_slopes(low, high, share, d_sd, student)
    assert_allclose(slope / sd, (at(step) - at(-step)) / (2.0 * step), rtol=1e-5, atol=1e-9)
    assert 0.0 <= curvature <= 1.0


# One sensor of speed and one of runout, on a slope that gets gentler.

SPEED_M, SD_SPEED, SD_STOP = 150.0, 1.0, 10.0
MODELS = ["robust", "normal", "student", "correlated", "scaled"]
KNOWN = [
    ((20.0, np.nan, Status.OBSERVED), (480.0, np.nan, Status.AT_LEAST)),
    ((20.0, np.nan, Status.OBSERVED), (480.0, np.nan, Status.AT_MOST)),
    ((18.0, np.nan, Status.AT_LEAST), (500.0, np.nan, Status.OBSERVED)),
    ((16.0, 19.0, Status.BETWEEN), (460.0, 520.0, Status.BETWEEN)),
    ((17.0, np.nan, Status.AT_MOST), (0.0, np.nan, Status.MISSING)),
    ((19.0, np.nan, Status.OBSERVED), (505.0, np.nan, Status.OBSERVED)),
]


def campaign_of(known: list[tuple[tuple[float, float, Status], ...]] = KNOWN) -> Campaign:
    x = np.linspace(0.0, 900.0, 91)
    z = np.interp(x, [0.0, 300.0, 900.0], [240.0, 60.0, 0.0])
    numbers = np.array([[(value, value_to) for value, value_to, _ in row] for row in known])
    status = np.array([[int(one[2]) for one in row] for row in known], dtype=np.int8)
    values = np.where(status == Status.MISSING, np.nan, numbers[..., 0])
    sensors = (
        Sensor("gate", "front_velocity", SPEED_M, SPEED_M, 0.05, SD_SPEED),
        Sensor("stop", "runout", np.nan, np.nan, 0.0, SD_STOP),
    )
    return Campaign(
        "bounds", "", "", "simulated", None, Track(x, z), sensors,
        tuple(Event(f"{k}", 20.0, None, {}) for k in range(len(known))),
        values, status, np.full(values.shape, np.nan), numbers[..., 1],
    )  # fmt: skip


def problem_of(name: str, campaign: Campaign | None = None) -> HierarchicalProblem:
    problem = hierarchical_problem(campaign_of() if campaign is None else campaign)
    return replace(problem, error_model=ERROR_MODELS[name])


def density_by_hand(problem: HierarchicalProblem, event: int, fronts: np.ndarray) -> np.ndarray:
    """Likelihood of an event at many fronts: cases of the error model, sides by scipy's distributions."""
    campaign, errors = problem.campaign, problem.error_model.errors
    sd = np.column_stack([np.hypot(0.05 * fronts[:, 0], SD_SPEED), np.full(len(fronts), SD_STOP)])
    values, values_to, status = campaign.values[event], campaign.values_to[event], campaign.status[event]
    total = np.zeros(len(fronts))
    for weight, scale, share in zip(errors.weights, errors.scales, errors.shares, strict=True):
        part = np.full(len(fronts), weight)
        for j in range(2):
            kinds = [(1.0 - share, scale), (share, scale * OUTLIER_FACTOR)]
            density = np.zeros(len(fronts))
            for kind, wide in kinds:
                one = (
                    t(4, fronts[:, j], wide * sd[:, j])
                    if errors.degrees
                    else norm(fronts[:, j], wide * sd[:, j])
                )
                match Status(status[j]):
                    case Status.OBSERVED:
                        density += kind * one.pdf(values[j])
                    case Status.AT_LEAST:
                        density += kind * one.sf(values[j])
                    case Status.AT_MOST:
                        density += kind * one.cdf(values[j])
                    case Status.BETWEEN:
                        density += kind * (one.cdf(values_to[j]) - one.cdf(values[j]))
                    case _:
                        density += kind
            part *= density
        total += part
    moved = status[0] in (Status.OBSERVED, Status.AT_LEAST, Status.BETWEEN)
    return total * (norm.cdf((fronts[:, 1] - SPEED_M) / problem.place_sd_m) if moved else 1.0)


@pytest.mark.parametrize("name", MODELS)
def test_the_integrated_likelihood_is_that_of_brute_force(name: str) -> None:
    problem = problem_of(name)
    median, spread = 0.3, 0.25
    logs = np.log(median) + spread * np.linspace(-6.0, 6.0, 6001)
    fronts = problem.predict(COULOMB.mechanisms, np.exp(logs)[:, None], np.full(len(logs), 20.0))
    prior = norm.pdf(logs, np.log(median), spread)
    found = problem.log_likelihood(COULOMB, {"dry_friction": [median], "dry_friction_spread": [spread]})[0]
    for event in range(len(KNOWN)):
        expected = np.log(np.trapezoid(density_by_hand(problem, event, fronts[:, :2]) * prior, logs))
        assert_allclose(found[event], expected, atol=0.01, err_msg=str(event))


@pytest.mark.parametrize("name", MODELS)
def test_no_prediction_of_a_box_is_better_than_its_bound(name: str) -> None:
    problem, rng = problem_of(name), np.random.default_rng(2)
    events = np.repeat([2, 3, 4], 80)
    low = rng.uniform([5.0, 200.0, 200.0], [30.0, 700.0, 700.0], (len(events), 3))
    low[:, 2] = low[:, 1]
    high = low + rng.uniform(0.0, [8.0, 150.0, 150.0], low.shape)
    high[:, 2] = high[:, 1]
    errors = problem.error_model.errors
    bounds = log_likelihood_bounds(events, low, high, problem.readings, errors)
    for share in rng.random((60, 2)):
        inside = low + share[[0, 1, 1]] * (high - low)
        # A common error is taken from a grid.
        slack = 0.2 if name == "correlated" else 1e-9
        assert np.all(log_likelihoods(events, inside, problem.readings, errors) <= bounds + slack)


def test_a_bound_far_off_says_nothing_or_decides() -> None:
    """At least 60 m: nothing learnt. At least 880 m, which the law hardly reaches: friction must be low."""
    usual = ((20.0, np.nan, Status.MISSING), (500.0, np.nan, Status.MISSING))
    rows = [
        ((20.0, np.nan, Status.MISSING), (60.0, np.nan, Status.AT_LEAST)),
        ((20.0, np.nan, Status.MISSING), (880.0, np.nan, Status.AT_LEAST)),
        usual,
        ((20.0, np.nan, Status.OBSERVED), (480.0, np.nan, Status.OBSERVED)),
    ]
    problem = problem_of("normal", campaign_of(rows))
    medians = np.array([0.05, 0.3, 0.45])
    found = problem.log_likelihood(COULOMB, {"dry_friction": medians, "dry_friction_spread": np.full(3, 0.1)})
    assert_allclose(found[:, 0], 0.0, atol=0.01)
    assert np.all(np.isfinite(found[:, 1])) and np.all(np.diff(found[:, 1]) < 0.0)
    assert found[0, 1] > -0.1 and found[1, 1] < -2.0 and found[2, 1] < -15.0


def test_the_relative_part_of_an_error_is_of_the_prediction() -> None:
    readings = event_readings(campaign_of())
    predictions = np.array([[30.0, 500.0, 500.0]])
    found = log_likelihoods(np.array([4]), predictions, readings, ERROR_MODELS["normal"].errors)
    assert_allclose(found, norm.logcdf((17.0 - 30.0) / np.hypot(1.5, 1.0)), rtol=1e-10)


COVARIANCE = np.array([[9.0, 6.0, 40.0], [6.0, 16.0, 60.0], [40.0, 60.0, 900.0]])
RESPONSE = np.array([[20.0, 12.0, 480.0]])
LEAST = np.array(
    [[-INF, -INF, 500.0], [-INF, 10.0, 450.0], [-INF, 9.0, -INF], [18.0, 10.0, 470.0], [-INF] * 3]
)
MOST = np.array([[INF, INF, INF], [INF, INF, 490.0], [INF, 11.0, 430.0], [21.0, INF, INF], [INF, 9.0, 600.0]])


def pooled_case():  # type: ignore[no-untyped-def]
    bounded = np.isfinite(LEAST) | np.isfinite(MOST)
    values = np.where(bounded, np.nan, [21.0, 13.0, 470.0])
    none, release = np.zeros_like(bounded), np.zeros(len(values), dtype=np.int64)
    return values, bounded, pooled_arrays(values, ~bounded, none, release, COVARIANCE, LEAST, MOST)


def test_the_pooled_likelihood_of_bounds_is_that_of_a_normal_distribution() -> None:
    values, bounded, arrays = pooled_case()
    found = pooled_log_density(RESPONSE, arrays)
    for k, (row, hidden) in enumerate(zip(values, bounded, strict=True)):
        seen = ~hidden
        expected, mean, covariance = 0.0, RESPONSE[0][hidden], COVARIANCE[np.ix_(hidden, hidden)]
        if seen.any():
            own, across = COVARIANCE[np.ix_(seen, seen)], COVARIANCE[np.ix_(hidden, seen)]
            expected += multivariate_normal.logpdf(row[seen], RESPONSE[0][seen], own)
            mean = mean + across @ np.linalg.solve(own, row[seen] - RESPONSE[0][seen])
            covariance = covariance - across @ np.linalg.solve(own, across.T)
        most, least = MOST[k][hidden], LEAST[k][hidden]
        inside = multivariate_normal.cdf(
            np.minimum(most, 1e4),
            mean,
            covariance,
            lower_limit=np.maximum(least, -1e4),
            abseps=1e-9,
            releps=1e-9,
        )
        assert_allclose(found[k], expected + np.log(inside), atol=2e-5)


def test_the_pullback_of_pooled_bounds_is_the_derivative() -> None:
    _, _, arrays = pooled_case()
    cotangent = np.array([1.0, -0.5, 2.0, 0.3, 0.7])
    pulled = pooled_log_density_pullback(cotangent, RESPONSE, arrays)
    for j, step in enumerate((1e-4, 1e-4, 1e-3)):
        change = np.zeros((1, 3))
        change[0, j] = step
        sides = [cotangent @ pooled_log_density(RESPONSE + sign * change, arrays) for sign in (1.0, -1.0)]
        assert_allclose(pulled[0, j], (sides[0] - sides[1]) / (2.0 * step), rtol=1e-5)
    far = arrays._replace(cut=arrays.cut + np.array([1e4, 0.0, 0.0, 0.0]))
    steep = pooled_log_density_pullback(np.eye(5)[0], RESPONSE, far)
    assert np.all(np.isfinite(pooled_log_density(RESPONSE, far))) and np.all(np.isfinite(steep))
    assert steep[0, 2] > 0.0


@cache
def half_known(n_events: int = 60) -> tuple[Campaign, Campaign]:
    """Simulated avalanches, runouts known by bounds at a road and a bridge; and all as they are."""
    rng = np.random.default_rng(9)
    blank = campaign_of([KNOWN[-1]] * n_events)
    problem = hierarchical_problem(blank)
    frictions = 0.3 * np.exp(0.2 * rng.standard_normal(n_events))
    fronts = problem.predict(COULOMB.mechanisms, frictions[:, None], np.full(n_events, 20.0))
    speeds = fronts[:, 0] + np.hypot(0.05 * fronts[:, 0], SD_SPEED) * rng.standard_normal(n_events)
    stops = fronts[:, 1] + SD_STOP * rng.standard_normal(n_events)
    road, bridge = 430.0, 520.0
    rows = []
    for k, (speed, stop) in enumerate(zip(speeds, stops, strict=True)):
        gate = (speed, np.nan, Status.OBSERVED if k % 4 == 0 else Status.MISSING)
        if stop < road:
            rows.append((gate, (road, np.nan, Status.AT_MOST)))
        elif stop > bridge:
            rows.append((gate, (bridge, np.nan, Status.AT_LEAST)))
        else:
            rows.append((gate, (road, bridge, Status.BETWEEN)))
    exact = [(row[0], (stop, np.nan, Status.OBSERVED)) for row, stop in zip(rows, stops, strict=True)]
    return campaign_of(rows), campaign_of(exact)


def test_bounds_alone_recover_the_population() -> None:
    medians, spreads = np.meshgrid(np.linspace(0.22, 0.4, 37), np.linspace(0.08, 0.4, 33), indexing="ij")
    samples = {"dry_friction": medians.ravel(), "dry_friction_spread": spreads.ravel()}

    def posterior(campaign: Campaign) -> tuple[np.ndarray, np.ndarray]:
        heights = problem_of("normal", campaign).log_likelihood(COULOMB, samples).sum(axis=1)
        weights = np.exp(heights - heights.max())
        weights /= weights.sum()
        points = np.log(np.column_stack(list(samples.values())))
        mean = weights @ points
        return mean, np.sqrt(weights @ (points - mean) ** 2)

    truth = np.log([0.3, 0.2])
    bounded, exact = (posterior(campaign) for campaign in half_known())
    assert np.all(np.abs(bounded[0] - truth) < 2.5 * bounded[1])
    assert np.all(np.abs(exact[0] - truth) < 2.5 * exact[1])
    # Bounds say less than readings, and much more than nothing.
    assert np.all(exact[1] < bounded[1]) and np.all(bounded[1] < [0.1, 0.4])


def test_the_pooled_covariance_needs_readings_and_takes_bounds_as_missing() -> None:
    bounded, exact = half_known()
    third, values = np.arange(60)[:, None] % 3 == 0, np.nan_to_num(exact.values, nan=20.0)
    mixed = replace(
        exact,
        status=np.where(third, bounded.status, Status.OBSERVED),
        values=np.where(third, bounded.values, values),
        values_to=np.where(third, bounded.values_to, np.nan),
    )
    problem = pooled_problem(mixed)
    found = problem.log_density(COULOMB.mechanisms, np.array([[0.25], [0.3], [0.4]]))
    assert found.shape == (3, 60) and np.all(np.isfinite(found))
    with pytest.raises(ValueError, match="fewer than two different readings"):
        pooled_problem(bounded)
