"""Slopes of the log likelihood against differences of the log likelihood itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skred.diagnosis.evidence.score_information import reading_slopes
from skred.inference.error_model import ERROR_MODELS, EventReadings
from skred.inference.reading_density import log_likelihoods

MODELS = ["normal", "robust", "student", "scaled", "correlated"]
INF = np.inf


def readings_of(
    values: np.ndarray,
    stated: float = 0.0,
    *,
    reached: float = -INF,
    not_reached: float = INF,
    least=None,
    most=None,
):  # type: ignore[no-untyped-def]
    """Two speeds and a runout, for each row of values."""
    n = len(values)
    observed = np.isfinite(values)
    return EventReadings(
        np.where(observed, values, 0.0),
        observed,
        np.where(observed, np.array([stated, 0.0, 0.0]), 0.0),
        np.array([0.1, 0.06, 0.0]),
        np.array([0.5, 0.3, 7.0]),
        np.array([True, True, False]),
        np.full(n, reached),
        np.full(n, not_reached),
        8.0,
        np.full((n, 3), -INF) if least is None else np.tile(least, (n, 1)),
        np.full((n, 3), INF) if most is None else np.tile(most, (n, 1)),
    )


def differences(predictions: np.ndarray, readings: EventReadings, errors) -> np.ndarray:  # type: ignore[no-untyped-def]
    at = np.arange(len(predictions))
    columns = []
    for j in range(predictions.shape[1]):
        step = np.zeros(predictions.shape[1])
        step[j] = 1e-4
        high = log_likelihoods(at, predictions + step, readings, errors)
        columns.append((high - log_likelihoods(at, predictions - step, readings, errors)) / 2e-4)
    return np.array(columns).T


@pytest.mark.parametrize("stated", [0.0, 1.7])
@pytest.mark.parametrize("model", MODELS)
def test_slopes_are_derivatives(model: str, stated: float) -> None:
    """Residuals from none to forty standard deviations, gaps, every case of the mixtures."""
    rng = np.random.default_rng(0)
    n = 60
    predictions = np.column_stack([rng.uniform(5.0, 50.0, (n, 2)), np.zeros((n, 2))])
    predictions[:, 2:] = rng.uniform(800.0, 1500.0, (n, 1))
    sizes = rng.choice([0.0, 1.0, 3.0, 5.5, 12.0, 40.0], (n, 3)) * rng.choice([-1.0, 1.0], (n, 3))
    sd = np.hypot(np.array([0.1, 0.06, 0.0]) * predictions[:, :3], np.array([0.5, 0.3, 7.0]))
    if stated:
        sd[:, 0] = stated
    values = predictions[:, :3] + sizes * sd
    values[rng.random((n, 3)) < 0.15] = np.nan
    readings, errors = readings_of(values, stated, reached=1000.0, not_reached=1200.0), ERROR_MODELS[model]
    slope, curvature, _ = reading_slopes(np.arange(n), predictions, readings, errors.errors)
    numeric = differences(predictions, readings, errors.errors)
    inside = np.abs(np.clip(predictions[:, 3], 1000.0, 1200.0) - predictions[:, 3]) < 6.0 * 8.0
    assert_allclose(slope[:, :3], numeric[:, :3], rtol=2e-4, atol=2e-5)
    assert_allclose(slope[inside, 3], numeric[inside, 3], rtol=1e-4, atol=2e-5)
    assert np.all(curvature >= 0.0) and np.all(slope[:, :3][np.isnan(values)] == 0.0)


def test_rows_choose_their_readings() -> None:
    """Rows in any order, repeated: as one by one."""
    values = np.array([[20.0, 30.0, 900.0], [np.nan, 12.0, np.nan]])
    readings, errors = readings_of(values), ERROR_MODELS["robust"].errors
    rows = np.array([1, 0, 1])
    predictions = np.array([[18.0, 13.0, 880.0, 880.0], [22.0, 28.0, 905.0, 905.0], [9.0, 3.0, 1.0, 1.0]])
    slope, curvature, _ = reading_slopes(rows, predictions, readings, errors)
    for i, row in enumerate(rows):
        one = readings._replace(
            **{
                name: getattr(readings, name)[[row]]
                for name in ("values", "observed", "stated_sd", "reached", "not_reached")
            }
        )
        alone = reading_slopes(np.array([0]), predictions[[i]], one, errors)
        assert_allclose(slope[i], alone[0][0])
        assert_allclose(curvature[i], alone[1][0])
    assert slope[0, 0] == 0.0 and slope[1, 0] != 0.0


@pytest.mark.parametrize("reached,not_reached", [(1000.0, INF), (-INF, 1000.0), (1000.0, 1030.0)])
@pytest.mark.parametrize("z", [-30.0, -12.0, -6.5, -5.5, -2.0, 0.0, 1.0, 5.9, 6.1, 8.0, 25.0])
def test_stop(z: float, reached: float, not_reached: float) -> None:
    """First and second derivative of the log probability of where it stopped, far out as well.

    The tails are the first two terms of the inverse Mills ratio: exact to 2 / z^4.
    """
    stop = 1000.0 + 8.0 * z
    readings = readings_of(np.full((1, 3), np.nan), reached=reached, not_reached=not_reached)
    errors, at = ERROR_MODELS["normal"].errors, np.array([0])

    def height(place: float) -> float:
        return float(log_likelihoods(at, np.array([[0.0, 0.0, 0.0, place]]), readings, errors)[0])

    slope, curvature, _ = reading_slopes(at, np.array([[0.0, 0.0, 0.0, stop]]), readings, errors)
    first = (height(stop + 0.01) - height(stop - 0.01)) / 0.02
    second = (height(stop + 0.2) - 2.0 * height(stop) + height(stop - 0.2)) / 0.04
    assert_allclose(slope[0, 3], first, rtol=3e-3, atol=1e-6)
    # The tail's curvature is 1 / sd^2 for it: 1 - 1/z^2.
    assert_allclose(curvature[0, 3], -second, rtol=0.04, atol=2e-5)


@pytest.mark.parametrize("model", ["normal", "correlated"])
def test_information_is_the_expected_square_of_the_slopes(model: str) -> None:
    """Fisher's information two ways, its standard deviation moving with the prediction."""
    errors = ERROR_MODELS[model].errors
    prediction = np.array([20.0, 12.0, 900.0, 900.0])
    sd = np.hypot(np.array([0.1, 0.06, 0.0]) * prediction[:3], np.array([0.5, 0.3, 7.0]))
    nodes, weights = np.polynomial.hermite_e.hermegauss(21)
    normal = np.stack(np.meshgrid(nodes, nodes, nodes), axis=-1).reshape(-1, 3)
    weight = np.stack(np.meshgrid(weights, weights, weights), axis=-1).reshape(-1, 3).prod(axis=1)
    correlation = np.eye(3)
    correlation[0, 1] = correlation[1, 0] = errors.common
    values = prediction[:3] + normal @ np.linalg.cholesky(correlation).T * sd
    rows, predictions = np.arange(len(values)), np.tile(prediction, (len(values), 1))
    slope, curvature, shared = (
        found[:, :3] for found in reading_slopes(rows, predictions, readings_of(values), errors)
    )
    information = np.diag(curvature[0]) - np.outer(shared[0], shared[0])
    fisher = np.einsum("n,ni,nj->ij", weight / weight.sum(), slope, slope)
    if model == "normal":
        assert_allclose(information, fisher, rtol=1e-9, atol=1e-12)
    # With errors in common the standard deviations' own share is left as if each error were by itself.
    own = np.array([0.1, 0.06, 0.0]) ** 2 * prediction[:3] / sd**2
    of_means = information - np.diag(2.0 * own**2)
    exact = np.linalg.inv(correlation) / np.outer(sd, sd)
    assert_allclose(of_means, exact, rtol=1e-9, atol=1e-12)
    assert_allclose(information, fisher, atol=0.05 * fisher.max())


def test_an_outlier_pulls_less() -> None:
    """Twenty standard deviations off: as a reading six times as uncertain under `robust`."""
    values = np.array([[20.0 + 20.0 * 2.0, np.nan, np.nan]])
    readings = readings_of(values, stated=2.0)
    prediction = np.array([[20.0, 0.0, 0.0, 0.0]])
    normal = reading_slopes(np.array([0]), prediction, readings, ERROR_MODELS["normal"].errors)
    robust = reading_slopes(np.array([0]), prediction, readings, ERROR_MODELS["robust"].errors)
    assert_allclose(normal[0][0, 0], 10.0)
    assert_allclose(robust[0][0, 0], 10.0 / 36.0, rtol=1e-6)
    assert_allclose(robust[1][0, 0] * 36.0, normal[1][0, 0], rtol=1e-6)
