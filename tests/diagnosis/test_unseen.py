"""Scores and predictions of avalanches that a calibration has not seen, and predictors as plain data."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import first_events, trial, with_sensors
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import logsumexp
from scipy.stats import norm

from skred.campaign import Campaign, Status
from skred.campaign.parts import of_events
from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.evidence.coefficient import curve_at, fit_base
from skred.diagnosis.evidence.covariates import Standard
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.diagnosis.evidence.predictive import Predicted
from skred.diagnosis.predict.draws import LeftOut
from skred.diagnosis.predict.draws import predictions as by_draws
from skred.diagnosis.predict.gain import realised_gain
from skred.diagnosis.predict.predictor_document import as_dict, from_dict
from skred.diagnosis.predict.unseen import (
    Predictor,
    Term,
    extension_of,
    log_scores,
    predictor_of,
    unseen,
)
from skred.errors import InputError
from skred.inference.calibrate import Calibration, calibrate
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.reading_density import log_likelihoods
from skred.inference.sampling import SamplerSettings
from skred.physics.kernel.columns import Column
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape
from skred.physics.mechanisms.stretches import U_1, U_2

GATE, FACTOR = 2, 1.3
SETTINGS = SamplerSettings("metropolis", 1000, 500, 4, 0)
CLOSE = 0.05
"""Nats an event."""


def campaign() -> Campaign:
    """Ten avalanches past five gates, a runout each."""
    found = first_events(trial(1003, "dense", "nothing", "constant").campaign, 10)
    return with_sensors(found, [12, 15, 18, 21, 24, found.n_sensors - 1])


def biased() -> Campaign:
    values = np.array(campaign().values)
    values[:, GATE] *= FACTOR
    return replace(campaign(), values=values)


@pytest.fixture(scope="module")
def base() -> Calibration:
    return calibrate(hierarchical_problem(biased()), load_law("constant"), SETTINGS)


@pytest.fixture(scope="module")
def augmented(base: Calibration) -> Calibration:
    problem: Any = base.problem
    fitted = fit_base(problem, base.law, typical(population_draws(base, 0)))
    mechanism = mechanisms()["sensor_bias"]
    shape = Shape(sensor=biased().sensors[GATE].id)
    found = curve_at(fitted, placed(mechanism, fitted.setting, shape), np.linspace(-0.3, 0.6, 10))
    return calibrate(augmented_problem(fitted, [found]), base.law, SETTINGS)


def by_hand(n_draws: int = 3, *terms: Term, strengths: Any = None) -> Predictor:
    """A predictor of the law with one constant retardation."""
    means = np.log(np.linspace(2.2, 2.6, n_draws))[:, None]
    factors = np.linspace(0.1, 0.2, n_draws)[:, None, None]
    drawn = np.empty((n_draws, 0)) if strengths is None else np.asarray(strengths, dtype=float)
    return Predictor("constant", "robust", 8.0, 10.0, means, factors, terms, drawn)


def predictions(predictor: Predictor, unseen: Campaign) -> Predicted:
    said = LeftOut(extension_of(predictor, unseen), predictor.draws)
    return by_draws([said] * unseen.n_events, 0)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["base", "augmented"])
def test_agrees_with_the_calibration_of_its_own_events(which: str, request: pytest.FixtureRequest) -> None:
    """By its own pointwise log likelihood, which comes from surfaces, or tables, instead of these nodes."""
    calibration: Calibration = request.getfixturevalue(which)
    pointwise = calibration.tree["log_likelihood"]["recordings"].transpose("chain", "draw", "event").values
    pointwise = pointwise.reshape(-1, pointwise.shape[-1])
    predictor = predictor_of(calibration, 400)
    scores = log_scores(predictor, biased())
    assert_allclose(scores, logsumexp(pointwise, axis=0) - np.log(len(pointwise)), atol=CLOSE)
    chosen = np.linspace(0, len(pointwise) - 1, 400).round().astype(int)
    assert_allclose(scores, logsumexp(pointwise[chosen], axis=0) - np.log(400), atol=0.02)


def test_what_was_missing_predicts_unseen_avalanches_better(
    base: Calibration, augmented: Calibration
) -> None:
    found = trial(1003, "dense", "nothing", "constant")
    fresh = with_sensors(found.fresh, [12, 15, 18, 21, 24, found.fresh.n_sensors - 1])
    values = np.array(fresh.values)
    values[:, GATE] *= FACTOR
    fresh = replace(fresh, values=values)
    document = json.loads(
        json.dumps({"before": as_dict(predictor_of(base)), "after": as_dict(predictor_of(augmented))})
    )
    gain = realised_gain(document, fresh)
    assert gain is not None and gain["n_fresh"] == 12 and gain["realised"] > 1.0
    expected = log_scores(predictor_of(augmented), fresh) - log_scores(predictor_of(base), fresh)
    assert gain["realised"] == pytest.approx(expected.mean())
    assert realised_gain(document | {"after": None}, fresh) is None
    held = unseen(predictor_of(augmented), fresh)
    seen = np.asarray(fresh.status) == Status.OBSERVED
    assert_array_equal(np.isfinite(held.predicted.mean), seen)
    assert 0.7 < held.predicted.covered(fresh.values, seen)[seen].mean() <= 1.0


@pytest.mark.parametrize("strengths", [[[-0.05], [0.0], [0.08]], [[0.06], [0.06], [0.06]]])
def test_scores_are_those_of_a_dense_sum(strengths: list[list[float]]) -> None:
    """Of each event's own retardation, for three draws with three strengths of a biased sensor, or one."""
    few = of_events(campaign(), [0, 3, 4])
    term = Term("sensor_bias", Shape(sensor=few.sensors[GATE].id))
    predictor = by_hand(3, term, strengths=strengths)
    extension = extension_of(predictor, few)
    readings, errors = extension.problem.readings, extension.problem.error_model.errors
    logs = np.linspace(np.log(0.8), np.log(6.0), 20001)
    events = np.repeat(np.arange(3), len(logs))
    points = np.column_stack([np.tile(logs, 3), np.zeros(len(events))])
    total = []
    for mean, factor, added in zip(predictor.means, predictor.factors, predictor.strengths, strict=True):
        likelihood = log_likelihoods(events, extension.predict(events, points, added), readings, errors)
        population = norm.logpdf(logs, mean[0], factor[0, 0]) + np.log(logs[1] - logs[0])
        total.append(logsumexp(likelihood.reshape(3, -1) + population, axis=1))
    expected = logsumexp(total, axis=0) - np.log(3.0)
    assert_allclose(log_scores(predictor, few), expected, atol=0.03)


def test_a_covariate_keeps_the_scale_that_it_was_fitted_on() -> None:
    """All of these avalanches are two standard deviations warm, so friction is shifted for all of them."""
    events = tuple(replace(one, covariates={"temperature_degC": -1.0}) for one in campaign().events)
    warm = replace(campaign(), events=events)
    term = Term("covariate_friction", Shape(covariate="temperature_degC"), Standard(-5.0, 2.0))
    predictor = by_hand(40, term, strengths=np.full((40, 1), 0.1))
    shifted = by_hand(40)
    shifted = replace(shifted, means=shifted.means + 0.2)
    assert_allclose(log_scores(predictor, warm), log_scores(shifted, warm), atol=0.02)
    assert np.abs(log_scores(by_hand(40), warm) - log_scores(shifted, warm)).max() > 0.5
    assert_allclose(predictions(predictor, warm).mean, predictions(shifted, warm).mean, rtol=1e-9)
    far = replace(warm, events=tuple(replace(e, covariates={"temperature_degC": 900.0}) for e in events))
    with pytest.raises(InputError, match="temperature_degC"):
        log_scores(predictor, far)


def test_text_of_two_kinds_and_what_is_not_known() -> None:
    standard = Standard(0.5, 0.5, ("dry", "wet"))
    kinds = ("wet", "dry", None, "other", 3.0)
    events = [
        replace(one, covariates={"snow": kind}) for one, kind in zip(campaign().events, kinds, strict=False)
    ]
    assert standard.standardised(events, "snow").tolist() == [1.0, -1.0, 0.0, 0.0, 0.0]


def test_a_logarithm_of_what_has_none_is_not_known() -> None:
    standard = Standard(np.log(100.0), np.log(10.0), logarithm=True)
    values = (1000.0, 100.0, 0.0, -3.0, None)
    events = [
        replace(one, covariates={"volume_m3": value})
        for one, value in zip(campaign().events, values, strict=False)
    ]
    assert_allclose(standard.standardised(events, "volume_m3"), [1.0, 0.0, 0.0, 0.0, 0.0], atol=1e-12)


def test_predictions_hold_what_they_should() -> None:
    """A front of the mean population, read by a sensor that is biased by a known factor."""
    few, sensor = of_events(campaign(), [0, 3]), campaign().sensors[GATE].id
    plain = predictions(by_hand(60), few)
    term = Term("sensor_bias", Shape(sensor=sensor))
    found = predictions(by_hand(60, term, strengths=np.full((60, 1), np.log(FACTOR))), few)
    assert found.mean.shape == found.low.shape == found.high.shape == (2, few.n_sensors)
    assert np.all(found.low < found.mean) and np.all(found.mean < found.high)
    assert_allclose(found.mean[:, GATE], FACTOR * plain.mean[:, GATE], rtol=1e-9)
    others = np.arange(few.n_sensors) != GATE
    assert_array_equal(found.mean[:, others], plain.mean[:, others])
    seen = np.ones(found.low.shape, dtype=bool)
    assert_array_equal(found.covered(0.5 * (found.low + found.high), seen), 1.0)
    assert_array_equal(found.covered(found.high + 1e-6, seen), 0.0)
    assert np.isnan(found.covered(found.mean, ~seen)).all()


def test_a_predictor_comes_back_as_it_was(augmented: Calibration) -> None:
    predictor = predictor_of(augmented, 50)
    again = from_dict(json.loads(json.dumps(as_dict(predictor), allow_nan=False)))
    assert len(predictor.means) == 50 and again.terms == predictor.terms
    assert (again.law, again.error_model) == (predictor.law, predictor.error_model)
    for name in ("means", "factors", "strengths"):
        assert_array_equal(getattr(again, name), getattr(predictor, name))
    few = of_events(biased(), [1, 2])
    assert_array_equal(log_scores(again, few), log_scores(predictor, few))


def document() -> dict[str, Any]:
    shape = Shape(400.0, 500.0)
    covariate = Term("covariate_friction", Shape(covariate="x"), Standard(1.0, 2.0, logarithm=True))
    terms = (Term("segment_drag", shape), covariate)
    return as_dict(by_hand(2, *terms, strengths=[[1e-3, 0.1], [2e-3, 0.1]]))


def test_an_opposed_drag_is_kept_and_read_back() -> None:
    """What opposes it needs nothing but its constants; with one of them alone it is no shape."""
    constants = ((U_1, 30.0), (U_2, 20.0))
    opposed = by_hand(
        2, Term("segment_drag", Shape(400.0, 600.0, constants=constants)), strengths=[[1e-3]] * 2
    )
    again = from_dict(json.loads(json.dumps(as_dict(opposed))))
    assert again.terms == opposed.terms
    few = of_events(biased(), [1, 2])
    (direction,) = extension_of(again, few).directions
    assert direction.columns == (Column.QUADRATIC, Column.CONSTANT)
    inside = direction.profiles[0] > 0.0
    ratio = -direction.profiles[1, inside] / direction.profiles[0, inside]
    assert ratio.max() <= 30.0**2 and ratio.min() >= 20.0**2 and np.all(np.diff(ratio) < 0.0)
    half = replace(opposed, terms=(Term("segment_drag", Shape(400.0, 600.0, constants=constants[:1])),))
    with pytest.raises(InputError, match="a shape that it cannot have"):
        log_scores(half, few)


HOSTILE: dict[str, Any] = {
    "format": 2, "law": "../secrets", "error_model": "magic", "place_sd_m": 0.0, "smoothing_m": -1.0,
    "means": [["a"], ["b"]], "factors": [[[0.0]], [[0.1]]], "strengths": [[1e-3, 0.1]], "terms": "none",
}  # fmt: skip
IN_TERMS: list[tuple[int, str, Any]] = [
    (0, "mechanism", "gnomes"), (0, "mechanism", ["segment_drag"]), (0, "mechanism", "constant_retardation"),
    (0, "s_from_m", None), (0, "s_from_m", 600.0), (0, "s_to_m", float("nan")), (0, "constants", [["c", -1]]),
    (0, "constants", [1.0]), (1, "standard", {"centre": 0.0, "scale": 0.0, "kinds": []}),
    (1, "standard", {"centre": 0.0, "scale": 1.0, "kinds": ["a"]}),
    (1, "standard", {"centre": 0.0, "scale": 1.0, "kinds": [], "logarithm": 3}), (1, "covariate", 3.0),
]  # fmt: skip
NO_DRAWS: list[Any] = [
    None, [], "x", 3, [[]], [[10**400], [1.0]], [[1e300], [1.0]], [[float("nan")], [1.0]], [[True]] * 2,
    [["1"], ["1"]], [[[1.0]], [[1.0]]], [1.0, 1.0], [[1.0], []], [[1.0], [1.0, 1.0]], [[1.0] * 99] * 2,
]  # fmt: skip


@pytest.mark.parametrize("key", HOSTILE)
def test_what_is_no_predictor_is_refused(key: str) -> None:
    assert from_dict(document()).law == "constant"
    with pytest.raises(InputError, match=key):
        from_dict(document() | {key: HOSTILE[key]})
    missing = "format" if key == "format" else f"{key}: field required"
    with pytest.raises(InputError, match=missing):
        from_dict({name: value for name, value in document().items() if name != key})


@pytest.mark.parametrize(("number", "key", "value"), IN_TERMS)
def test_what_is_no_term_is_refused(number: int, key: str, value: Any) -> None:
    damaged = copy.deepcopy(document())
    part = damaged["terms"][number]
    (part if key in part else part["shape"])[key] = value
    with pytest.raises(InputError):
        from_dict(damaged)


@pytest.mark.parametrize("value", NO_DRAWS)
def test_means_must_be_draws(value: Any) -> None:
    with pytest.raises(InputError):
        from_dict(document() | {"means": value})
    for whole in (value, None, {}):
        with pytest.raises(InputError):
            from_dict(whole)


def test_other_paths_are_refused() -> None:
    few = of_events(campaign(), [0, 1])
    gone = by_hand(2, Term("sensor_bias", Shape(sensor="nowhere")), strengths=[[0.1], [0.1]])
    beyond = by_hand(2, Term("segment_drag", Shape(1e5, 2e5)), strengths=[[1e-3], [1e-3]])
    shapeless = by_hand(2, Term("obstacle", Shape()), strengths=[[3.0], [3.0]])
    for predictor, message in ((gone, "nowhere"), (beyond, "beyond"), (shapeless, "shape")):
        with pytest.raises(InputError, match=message):
            log_scores(predictor, few)
    documents = {"before": as_dict(by_hand()), "after": as_dict(by_hand())}
    gain = realised_gain(documents, few)
    assert gain is not None and gain["realised"] == 0.0 and gain["n_fresh"] == 2
    assert realised_gain(None, few) is None
    with pytest.raises(InputError):
        realised_gain([1], few)
