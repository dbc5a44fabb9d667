"""Densities of one event: readings given a front, their bounds, and the sum over a population."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytensor
import pytensor.tensor as pt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pytensor.gradient import DisconnectedInputError, verify_grad
from scipy.integrate import quad
from scipy.special import log_ndtr, logsumexp
from scipy.stats import multivariate_normal, norm
from scipy.stats import t as student_t

from skred.inference.error_model import ERROR_MODELS, Errors, EventReadings
from skred.inference.hierarchical.event_density import (
    draw_nodes,
    integrated_log_density,
    integrated_log_density_pullback,
)
from skred.inference.hierarchical.integrated_op import IntegratedLogDensity, IntegratedLogDensityPullback
from skred.inference.reading_density import assess, log_likelihood_bounds, log_likelihoods

# The readings given a front, written down again.

RELATIVE = np.array([0.1, 0.2, 0.05, 0.1, 0.0])
ABSOLUTE = np.array([1.0, 0.5, 2.0, 1.0, 12.0])
PLACE_SD = 8.0


def readings_of(
    values: np.ndarray,
    observed: np.ndarray | None = None,
    stated: np.ndarray | None = None,
    reached: float = -np.inf,
    not_reached: float = np.inf,
    least: np.ndarray | None = None,
    most: np.ndarray | None = None,
) -> EventReadings:
    """One event, four gates and a runout, as event number 1 of 2."""
    observed = np.ones(5, dtype=bool) if observed is None else observed
    stated = np.zeros(5) if stated is None else stated
    other = np.full(5, 7.0)
    return EventReadings(
        np.array([other, np.where(observed, values, 0.0)]),
        np.array([~observed, observed]),
        np.array([other, stated]),
        RELATIVE,
        ABSOLUTE,
        np.array([True, True, True, True, False]),
        np.array([0.0, reached]),
        np.array([5.0, not_reached]),
        PLACE_SD,
        np.full((2, 5), -np.inf) if least is None else np.array([np.full(5, -np.inf), least]),
        np.full((2, 5), np.inf) if most is None else np.array([np.full(5, np.inf), most]),
    )


def stop_term(stop: float, readings: EventReadings) -> float:
    """Log of Phi(not reached) - Phi(reached), from the tail in which both are small."""
    a = (readings.reached[1] - stop) / PLACE_SD
    b = (readings.not_reached[1] - stop) / PLACE_SD
    if a == -np.inf or b == np.inf:
        return float(log_ndtr(b) if a == -np.inf else log_ndtr(-a))
    if a + b > 0:
        a, b = -b, -a
    return float(log_ndtr(b) + np.log1p(-np.exp(log_ndtr(a) - log_ndtr(b))))


def residuals(prediction: np.ndarray, readings: EventReadings) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residuals, standard deviations and which are velocities, of the readings that there are."""
    seen = readings.observed[1]
    stated = readings.stated_sd[1]
    usual = np.sqrt((RELATIVE * prediction[:5]) ** 2 + ABSOLUTE**2)
    sd = np.where(stated > 0, stated, usual)
    return (readings.values[1] - prediction[:5])[seen], sd[seen], readings.is_velocity[seen]


def normal(r: np.ndarray, sd: np.ndarray, velocity: np.ndarray) -> float:
    return float(norm.logpdf(r, scale=sd).sum())


def robust(r: np.ndarray, sd: np.ndarray, velocity: np.ndarray) -> float:
    per_share = [
        np.logaddexp(
            np.log1p(-share) + norm.logpdf(r, scale=sd), np.log(share) + norm.logpdf(r, scale=6 * sd)
        )
        for share in (0.002, 0.02)
    ]
    return float(logsumexp([np.log(0.5) + terms.sum() for terms in per_share]))


def student(r: np.ndarray, sd: np.ndarray, velocity: np.ndarray) -> float:
    return float(student_t.logpdf(r, 4.0, scale=sd).sum())


def correlated(r: np.ndarray, sd: np.ndarray, velocity: np.ndarray) -> float:
    if len(r) == 0:
        return 0.0
    covariance = np.diag(sd**2)
    common = np.sqrt(0.5) * sd * velocity
    covariance = covariance + np.outer(common, common) - np.diag(common**2)
    return float(multivariate_normal.logpdf(r, np.zeros(len(r)), covariance))


def scaled(r: np.ndarray, sd: np.ndarray, velocity: np.ndarray) -> float:
    def log_integrand(u: float) -> float:
        return float(norm.logpdf(r, scale=sd * np.exp(0.5 * u)).sum() + norm.logpdf(u))

    nodes = np.linspace(-7.0, 10.0, 200)
    largest = max(map(log_integrand, nodes))
    integral = quad(lambda u: np.exp(log_integrand(u) - largest), -8, 12, epsrel=1e-9, limit=400)[0]
    return float(largest + np.log(integral))


BY_HAND: dict[str, Callable[..., float]] = {
    "robust": robust,
    "normal": normal,
    "student": student,
    "correlated": correlated,
    "scaled": scaled,
}
TOLERANCE = dict.fromkeys(BY_HAND, 1e-9) | {"scaled": 0.01}
"""In nats. The scaled errors are a sum over nodes; a test below says that they are enough."""


def by_hand(name: str, prediction: np.ndarray, readings: EventReadings) -> float:
    return stop_term(prediction[-1], readings) + BY_HAND[name](*residuals(prediction, readings))


def cases() -> dict[str, tuple[np.ndarray, EventReadings]]:
    """A front, and what was read of it."""
    front = np.array([34.0, 26.0, 21.0, 8.0, 1925.0, 1925.0])
    near = np.array([36.0, 24.0, 19.0, 9.5, 1930.0])
    some = np.array([True, False, True, False, True])
    stated = np.array([2.5, 0.0, 0.0, 0.6, 23.0])
    stopped = np.array([34.0, 26.0, 0.0, 0.0, 1800.0, 1800.0])
    return {
        "all": (front, readings_of(near)),
        "some": (front, readings_of(near, some)),
        "stated": (front, readings_of(near, stated=stated)),
        "only a runout": (front, readings_of(near, np.arange(5) == 4)),
        "only a gate": (front, readings_of(near, np.arange(5) == 1)),
        "nothing": (front, readings_of(near, np.zeros(5, dtype=bool))),
        "outlier": (front, readings_of(near + np.array([0.0, 22.0, 0.0, 0.0, 0.0]))),
        "front is not there": (stopped, readings_of(np.array([33.0, 26.5, 0.3, 0.0, 1804.0]))),
        "reached": (front, readings_of(near, reached=1930.0)),
        "not reached": (front, readings_of(near, not_reached=1910.0)),
        "between": (front, readings_of(near, reached=1910.0, not_reached=1960.0)),
        "far above what it reached": (front, readings_of(near, reached=2050.0)),
        "far below what it did not reach": (front, readings_of(near, not_reached=1800.0)),
        "far below the interval": (front, readings_of(near, reached=1500.0, not_reached=1860.0)),
    }


CASES = cases()


def log_likelihood(event: int, prediction: np.ndarray, readings: EventReadings, errors: Errors) -> float:
    """Of one run alone."""
    return float(log_likelihoods(np.array([event]), prediction[None], readings, errors)[0])


def log_likelihood_bound(
    event: int, low: np.ndarray, high: np.ndarray, readings: EventReadings, errors: Errors
) -> float:
    """Of one box alone."""
    return float(log_likelihood_bounds(np.array([event]), low[None], high[None], readings, errors)[0])


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", BY_HAND)
def test_log_likelihood_by_hand(name: str, case: str) -> None:
    prediction, readings = CASES[case]
    found = log_likelihood(1, prediction, readings, ERROR_MODELS[name].errors)
    assert_allclose(found, by_hand(name, prediction, readings), rtol=1e-9, atol=TOLERANCE[name])


def test_cases_tell_the_error_models_apart() -> None:
    """As they must, to test anything."""
    prediction, readings = CASES["outlier"]
    values = [log_likelihood(1, prediction, readings, model.errors) for model in ERROR_MODELS.values()]
    assert np.min(np.diff(np.sort(values))) > 0.5


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([name for name in BY_HAND if name != "scaled"]),
    st.lists(st.floats(0.0, 60.0), min_size=4, max_size=4),
    st.lists(st.floats(-6.0, 6.0), min_size=5, max_size=5),
    st.lists(st.booleans(), min_size=5, max_size=5),
    st.floats(1200.0, 2300.0),
    st.sampled_from([-np.inf, 1650.0, 1810.0]),
    st.sampled_from([np.inf, 1910.0]),
)
def test_log_likelihood_of_any_front(
    name: str,
    speeds: list[float],
    z: list[float],
    observed: list[bool],
    stop: float,
    reached: float,
    not_reached: float,
) -> None:
    prediction = np.array([*speeds, stop, stop])
    sd = np.hypot(RELATIVE * prediction[:5], ABSOLUTE)
    readings = readings_of(prediction[:5] + sd * np.array(z), np.array(observed), None, reached, not_reached)
    found = log_likelihood(1, prediction, readings, ERROR_MODELS[name].errors)
    expected = by_hand(name, prediction, readings)
    if stop_term(stop, readings) < -600:
        assert np.isfinite(found) and found < -500
    else:
        assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("sd", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", [name for name in BY_HAND if name != "scaled"])
def test_more_readings_than_a_product_holds(name: str, sd: float) -> None:
    """Widths and tails are multiplied before logarithms are taken: 1e3 to the 400th is too much."""
    n, rng = 400, np.random.default_rng(11)
    z = rng.standard_normal(n) * np.where(rng.random(n) < 0.3, 30.0, 1.0)
    values, everything = 20.0 + sd * z, np.ones((1, n), dtype=bool)
    velocity = np.arange(n) < n - 1
    readings = EventReadings(
        values[None, :], everything, np.full((1, n), sd), np.zeros(n), np.zeros(n), velocity,
        np.array([-np.inf]), np.array([np.inf]), PLACE_SD, np.full((1, n), -np.inf), np.full((1, n), np.inf),
    )  # fmt: skip
    found = log_likelihood(0, np.full(n + 1, 20.0), readings, ERROR_MODELS[name].errors)
    assert_allclose(found, BY_HAND[name](sd * z, np.full(n, sd), velocity), rtol=1e-9)


def few_and_many(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    sd = rng.uniform(0.5, 3.0, n)
    return rng.standard_normal(n) * sd * rng.uniform(0.6, 1.5), sd


@pytest.mark.parametrize("n", [4, 20, 60])
def test_nodes_of_the_scaled_errors_are_enough(n: int) -> None:
    rng = np.random.default_rng(3)
    weights, scales, *_ = ERROR_MODELS["scaled"].errors
    differences = []
    for _ in range(40):
        r, sd = few_and_many(rng, n)
        found = logsumexp([norm.logpdf(r, scale=sd * s).sum() for s in scales], b=weights)
        differences.append(found - scaled(r, sd, r))
    assert np.abs(differences).max() < 0.01


@pytest.mark.parametrize("name", BY_HAND)
@pytest.mark.parametrize("stop", [0.0, 1000.0, 1e4])
def test_far_tails_are_finite_and_far(name: str, stop: float) -> None:
    errors = ERROR_MODELS[name].errors
    for shift in (1e2, 1e3, 1e4):
        prediction = np.array([shift, 0.0, 0.0, shift, stop + shift, stop])
        _, readings = CASES["between"]
        value = log_likelihood(1, prediction, readings, errors)
        assert np.isfinite(value) and value < log_likelihood(1, CASES["between"][0], readings, errors) - 20


def test_an_outlier_counts_as_one_however_far_it_is() -> None:
    """A robust model's point: 25 standard deviations off, and the others decide."""
    prediction, readings = CASES["all"]
    for z in (10.0, 25.0, 37.0):
        far = prediction[:5].copy()
        far[1] += z * np.hypot(RELATIVE[1] * prediction[1], ABSOLUTE[1])
        readings = readings_of(far)
        found = log_likelihood(1, prediction, readings, ERROR_MODELS["robust"].errors)
        assert_allclose(found, by_hand("robust", prediction, readings), rtol=1e-9)


@pytest.mark.parametrize("z", [40.0, 60.0])
def test_an_outlier_further_off_than_38_standard_deviations(z: float) -> None:
    prediction, _ = CASES["all"]
    far = prediction[:5].copy()
    far[4] += 12.0 * z
    readings = readings_of(far)
    found = log_likelihood(1, prediction, readings, ERROR_MODELS["robust"].errors)
    assert_allclose(found, by_hand("robust", prediction, readings), rtol=1e-6)


@pytest.mark.parametrize("short", [70.0, 100.0])
def test_an_interval_far_ahead_of_the_stop(short: float) -> None:
    prediction, _ = CASES["all"]
    readings = readings_of(prediction[:5], reached=1925.0 + short, not_reached=1925.0 + short + 100.0)
    found = log_likelihood(1, prediction, readings, ERROR_MODELS["normal"].errors)
    assert_allclose(found, by_hand("normal", prediction, readings), rtol=1e-6)


def test_log_likelihoods_is_each_of_them() -> None:
    prediction, readings = CASES["between"]
    errors = ERROR_MODELS["robust"].errors
    events = np.array([1, 0, 1])
    rows = np.array([prediction, prediction, 0.9 * prediction])
    expected = [log_likelihood(e, row, readings, errors) for e, row in zip(events, rows, strict=True)]
    assert_array_equal(log_likelihoods(events, rows, readings, errors), expected)
    assert len(set(expected)) == 3


# Bounds

UNTIGHT = {"robust": 0.1, "normal": 0.05, "student": 0.1, "scaled": 1.0, "correlated": 1.5}
"""How far, in nats, the bound may fall below: it takes the prediction nearest to each reading, although one
a little further off can be likelier because its error is smaller; and, for "correlated", a grid."""


def common_error(prediction: np.ndarray, readings: EventReadings) -> float:
    """Mean of the common error given the readings, in its standard deviations."""
    r, sd, velocity = residuals(prediction, readings)
    z = (r / sd)[velocity]
    return float(np.sqrt(0.5) * z.sum() / 0.5 / (1.0 + len(z)))


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(list(BY_HAND)),
    st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 40.0)), min_size=4, max_size=4),
    st.tuples(st.floats(1400.0, 2100.0), st.floats(0.0, 500.0)),
    st.lists(st.floats(0.0, 60.0), min_size=4, max_size=4),
    st.lists(st.booleans(), min_size=5, max_size=5),
    st.sampled_from([-np.inf, 1650.0, 1810.0]),
    st.sampled_from([np.inf, 1910.0, 2000.0]),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_bound_holds_within_the_box(
    name: str,
    speeds: list[tuple[float, float]],
    stops: tuple[float, float],
    values: list[float],
    observed: list[bool],
    reached: float,
    not_reached: float,
    is_stated: bool,
    seed: int,
) -> None:
    errors = ERROR_MODELS[name].errors
    low = np.array([*(a for a, _ in speeds), stops[0], stops[0]])
    high = low + np.array([*(b for _, b in speeds), stops[1], stops[1]])
    stated = np.array([2.0, 2.0, 0.0, 2.0, 9.0]) if is_stated else None
    readings = readings_of(np.array([*values, 1850.0]), np.array(observed), stated, reached, not_reached)
    bound = log_likelihood_bound(1, low, high, readings, errors)
    rng = np.random.default_rng(seed)
    inside = low + rng.beta(0.5, 0.5, (60, 6)) * (high - low)
    nearest = np.clip(np.append(readings.values[1], 0.5 * (reached + not_reached)), low, high)
    nearest[-1] = np.nan_to_num(nearest[-1], nan=low[-1])
    rows = np.concatenate([inside, [low, high, nearest]])
    inside_too = np.clip(nearest * rng.normal(1.0, 0.05, (60, 6)), low, high)
    rows = np.concatenate([rows, inside_too])
    if name == "correlated":  # beyond, see the test of large common errors in wide boxes
        rows = np.array([row for row in rows if abs(common_error(row, readings)) < 2.5])
        if len(rows) == 0:
            return
    most = log_likelihoods(np.ones(len(rows), dtype=np.int64), rows, readings, errors).max()
    assert most <= bound + UNTIGHT[name]


@pytest.mark.parametrize("z", [7.0, 12.0])
def test_bound_of_a_large_common_error(z: float) -> None:
    """A law that cannot be as fast as a front was: even its best place would be dropped."""
    errors = ERROR_MODELS["correlated"].errors
    prediction, _ = CASES["all"]
    readings = readings_of(prediction[:5] + z * np.hypot(RELATIVE * prediction[:5], ABSOLUTE))
    exact = log_likelihood(1, prediction, readings, errors)
    assert exact <= log_likelihood_bound(1, prediction, prediction, readings, errors) + UNTIGHT["correlated"]


def test_bound_of_large_common_errors_in_wide_boxes() -> None:
    errors, rng = ERROR_MODELS["correlated"].errors, np.random.default_rng(0)
    worst = -np.inf
    for _ in range(3000):
        low = np.array([*rng.uniform(0.0, 60.0, 4), 1800.0, 1800.0])
        high = low + np.array([*rng.uniform(0.0, 30.0, 4), 0.0, 0.0])
        off = rng.normal(0.0, 12.0) + rng.normal(0.0, 5.0, 4)
        values = np.array([*np.maximum(low[:4] + off, 0.0), 1800.0])
        readings = readings_of(values, np.append(rng.random(4) < 0.7, True))
        rows = low + rng.random((20, 6)) * (high - low)
        most = log_likelihoods(np.ones(20, dtype=np.int64), rows, readings, errors).max()
        worst = max(worst, most - log_likelihood_bound(1, low, high, readings, errors))
    assert worst < UNTIGHT["correlated"]


@pytest.mark.parametrize("name", [name for name in BY_HAND if name != "correlated"])
def test_bound_is_taken_on(name: str) -> None:
    """Or it would be no help: in a box of one front it is the likelihood, in a large one the best front's."""
    errors = ERROR_MODELS[name].errors
    prediction, readings = CASES["between"]
    exact = log_likelihood(1, prediction, readings, errors)
    assert_allclose(log_likelihood_bound(1, prediction, prediction, readings, errors), exact, rtol=1e-12)
    best = np.append(readings.values[1], 1935.0)
    bound = log_likelihood_bound(1, 0.5 * best, 2.0 * best, readings, errors)
    assert_allclose(bound, log_likelihood(1, best, readings, errors), rtol=1e-12)
    assert bound > exact + 0.2


def test_bound_of_correlated_errors_is_of_use() -> None:
    errors = ERROR_MODELS["correlated"].errors
    prediction, readings = CASES["between"]
    exact = log_likelihood(1, prediction, readings, errors)
    assert exact - 0.5 < log_likelihood_bound(1, prediction, prediction, readings, errors) < exact + 4.0


@pytest.mark.parametrize("name", BY_HAND)
def test_assessment_of_boxes(name: str) -> None:
    """Changes along the axes by hand; the best corner and the corners' mean times an envelope."""
    errors = ERROR_MODELS[name].errors
    prediction, readings = CASES["between"]
    factors = np.array([[1.0, 0.97, 1.02, 1.01], [0.9, 0.95, 1.3, 1.25], [1.0, 1.0, 1.0, 1.0]])
    predictions = factors[:, :, None] * prediction
    envelope = -np.arange(15.0).reshape(3, 5) / 10.0
    change, bound, top, mean = assess(np.ones(3, dtype=np.int64), predictions, readings, errors, envelope)
    for box in range(3):
        corners = np.array([log_likelihood(1, row, readings, errors) for row in predictions[box]])
        corners += envelope[box, 1:]
        assert_allclose(top[box], corners.max(), rtol=1e-12)
        assert_allclose(mean[box], logsumexp(corners) - np.log(4), rtol=1e-12)
        low, high = predictions[box].min(axis=0), predictions[box].max(axis=0)
        expected = log_likelihood_bound(1, low, high, readings, errors) + envelope[box, 0]
        assert_allclose(bound[box], expected, rtol=1e-12)
        nearest = np.clip(readings.values[1], low[:5], high[:5])
        sd = np.append(np.hypot(RELATIVE * nearest, ABSOLUTE), PLACE_SD)
        pairs = {0: [(0, 1), (2, 3)], 1: [(0, 2), (1, 3)]}
        for axis, sides in pairs.items():
            steps = [np.linalg.norm((predictions[box, b] - predictions[box, a]) / sd) for a, b in sides]
            assert_allclose(change[box, axis], max(steps), rtol=1e-12)


# The sum over a population


def nodes_of(n_strengths: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes of three events, not as many each, some so unlikely that they do not count; without widths."""
    rng = np.random.default_rng(seed)
    first = np.array([0, 40, 41, 141])
    points = np.ascontiguousarray(rng.normal(-1.0, 0.5, (n_strengths, 141)))
    log_weights = rng.normal(-50.0, 5.0, 141)
    log_weights[3], log_weights[60] = -1000.0, 300.0
    return first, points, log_weights, np.empty(0)


def population(n: int) -> tuple[np.ndarray, np.ndarray]:
    means = np.linspace(-1.2, -0.7, 3 * n).reshape(3, n)
    factor = np.tril(np.full((n, n), 0.11)) + np.diag(np.linspace(0.25, 0.4, n))
    return means, factor


def sum_by_hand(means: np.ndarray, factor: np.ndarray, *nodes: np.ndarray) -> np.ndarray:
    """From the covariance, so that the factor is not taken for granted; complex means and factors too."""
    first, points, log_weights, log_widths = nodes
    covariance = factor @ factor.T
    precision = np.linalg.inv(covariance)
    log_constant = -0.5 * np.log(np.linalg.det(2 * np.pi * covariance))
    result = []
    for e in range(len(means)):
        at = slice(first[e], first[e + 1])
        deviation = points[:, at].T - means[e]
        log_density = log_constant - 0.5 * np.einsum("ki,ij,kj->k", deviation, precision, deviation)
        found = log_sum_exp(log_weights[at] + log_density)
        if len(log_widths):
            there = log_sum_exp(log_widths[at] + log_density)
            found -= there if there.real > 0.0 else 0.0
        result.append(found)
    return np.array(result)


def log_sum_exp(values: np.ndarray) -> complex:
    """Of complex values, so that its imaginary part is a derivative."""
    shift = values.real.max()
    return shift + np.log(np.exp(values - shift).sum())


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("scale", [0.02, 1.0, 50.0])
def test_integrated_log_density_by_hand(n: int, scale: float) -> None:
    means, factor = population(n)
    found = integrated_log_density(means, scale * factor, *nodes_of(n))
    assert_allclose(found, sum_by_hand(means, scale * factor, *nodes_of(n)), rtol=1e-10)


def with_widths(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nodes of which the last event has more than all of the population, the others less."""
    first, points, log_weights, _ = nodes_of(n)
    log_widths = np.random.default_rng(3).normal(-3.0, 1.0, len(log_weights))
    log_widths[: first[2]] -= 5.0
    return first, points, log_weights, log_widths


@pytest.mark.parametrize("n", [1, 2, 3])
def test_an_event_with_more_than_all_of_a_population_has_the_mean_over_its_nodes(n: int) -> None:
    means, factor = population(n)
    free, found = (integrated_log_density(means, factor, *of(n)) for of in (nodes_of, with_widths))
    assert_allclose(found, sum_by_hand(means, factor, *with_widths(n)), rtol=1e-10)
    assert_array_equal(found[:2], free[:2])
    assert found[2] < free[2] - 0.1


@pytest.mark.parametrize("nodes_of", [nodes_of, with_widths])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_pullback_is_the_complex_step(n: int, nodes_of: Callable[[int], tuple[np.ndarray, ...]]) -> None:
    means, factor = population(n)
    nodes, cotangent = nodes_of(n), np.array([0.5, -1.0, 2.0])
    pulled = integrated_log_density_pullback(cotangent, means, factor, *nodes)
    assert pulled.shape == (3 + n, n)
    for row in range(3):
        for k in range(n):
            step = np.zeros((3, n), dtype=complex)
            step[row, k] = 1e-30j
            slope = cotangent @ sum_by_hand(means + step, factor, *nodes).imag / 1e-30
            assert_allclose(pulled[row, k], slope, rtol=1e-9, atol=1e-12)
    for i in range(n):
        for k in range(n):
            step = np.zeros((n, n), dtype=complex)
            step[i, k] = 1e-30j if k <= i else 0.0
            slope = cotangent @ sum_by_hand(means, factor + step, *nodes).imag / 1e-30
            assert_allclose(pulled[3 + i, k], slope, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("mode", ["NUMBA", "FAST_COMPILE"])
@pytest.mark.parametrize("n", [1, 2])
def test_op_in_both_backends(n: int, mode: str) -> None:
    values = population(n)
    means, factor = pt.dmatrix("means"), pt.dmatrix("factor")
    density = IntegratedLogDensity()(means, factor, *nodes_of(n))
    weights = np.array([0.5, -1.0, 2.0])
    gradients = pt.grad((density * weights).sum(), [means, factor])
    value, by_means, by_factor = pytensor.function([means, factor], [density, *gradients], mode=mode)(*values)
    assert_allclose(value, sum_by_hand(*values, *nodes_of(n)), rtol=1e-10)
    expected = integrated_log_density_pullback(weights, *values, *nodes_of(n))
    assert_allclose(np.concatenate([by_means, by_factor]), expected, rtol=1e-10, atol=1e-14)


def test_verify_grad() -> None:
    means, factor = population(2)
    below = np.tril_indices(2)

    def density(means: pt.TensorVariable, entries: pt.TensorVariable) -> pt.TensorVariable:
        lower = pt.stack([pt.stack([entries[0], 0.0]), pt.stack([entries[1], entries[2]])])
        return IntegratedLogDensity()(means, lower, *nodes_of(2))

    verify_grad(density, [means, factor[below]], rng=np.random.default_rng(0), eps=1e-6, mode="FAST_COMPILE")


def test_ops_are_equal_pickle_and_know_their_shapes() -> None:
    for kind in (IntegratedLogDensity, IntegratedLogDensityPullback):
        assert (
            kind() == kind() and hash(kind()) == hash(kind()) and pickle.loads(pickle.dumps(kind())) == kind()
        )
    assert IntegratedLogDensity() != IntegratedLogDensityPullback()
    values = population(2)
    node = IntegratedLogDensity()(*values, *nodes_of(2))
    assert node.type.shape == (3,)
    assert IntegratedLogDensityPullback()(np.ones(3), *values, *nodes_of(2)).type.shape == (5, 2)
    assert_array_equal(pickle.loads(pickle.dumps(node)).eval(), node.eval())
    means = pt.dmatrix("means")
    open_node = IntegratedLogDensity()(means, values[1], *nodes_of(2))
    assert pytensor.function([means], open_node.shape[0])(values[0]) == 3


def test_nodes_are_not_differentiated_by_and_wrong_inputs_are_named() -> None:
    first, points, log_weights, log_widths = nodes_of(2)
    weights = pt.dvector("log_weights")
    density = IntegratedLogDensity()(*population(2), first, points, weights, log_widths)
    with pytest.raises((DisconnectedInputError, NotImplementedError)):
        pt.grad(density.sum(), weights)
    with pytest.raises(TypeError, match="first: expected int64"):
        IntegratedLogDensity()(*population(2), first.astype(float), points, log_weights, log_widths)
    with pytest.raises(TypeError, match="means: expected 2 dimensions"):
        IntegratedLogDensity()(population(2)[0][0], population(2)[1], first, points, log_weights, log_widths)


def test_nodes_are_drawn_by_their_share() -> None:
    means, factor = population(2)
    first, points, log_weights, _ = nodes_of(2)
    n = 4000
    uniforms = np.random.default_rng(1).random((n, 3))
    # All events share a mean here: one population a row.
    drawn = draw_nodes(
        np.tile(means[1], (n, 1)), np.tile(factor, (n, 1, 1)), uniforms, first, points, log_weights
    )
    covariance = factor @ factor.T
    for e in range(3):
        at = np.arange(first[e], first[e + 1])
        exponent = log_weights[at] + multivariate_normal.logpdf(points[:, at].T, means[1], covariance)
        share = np.exp(exponent - logsumexp(exponent))
        count = np.bincount(drawn[:, e] - first[e], minlength=len(at))
        assert drawn[:, e].min() >= first[e] and len(count) == len(at)
        assert np.all(np.abs(count - n * share) <= 5.0 * np.sqrt(n * share * (1 - share)) + 1.0)
