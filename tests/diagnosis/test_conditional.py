"""Readings predicted from those above them, against closed forms and brute force."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from skred.campaign import Campaign, Status, find_campaign, read_campaign
from skred.diagnosis.evidence.conditional_map import campaign_rows
from skred.diagnosis.evidence.extension import Extension, extended, setting_of
from skred.diagnosis.influence.influence import Few, Influence
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.predict.conditional import BeforeAfter, Conditional, above, conditional, readings_of
from skred.diagnosis.predict.draws import Draws, LeftOut
from skred.diagnosis.predict.unseen import log_densities
from skred.diagnosis.verdict.conditional import conditional_document
from skred.diagnosis.verdict.given_above import given_above
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.reading_density import log_likelihoods
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import Shape

LC, CD, B, RUNOUT = range(4)
MEDIANS, SPREADS = np.log([0.25, 0.0025]), np.array([0.15, 0.4])


@pytest.fixture(scope="module")
def ryggfonn() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def with_errors(problem: HierarchicalProblem, name: str) -> HierarchicalProblem:
    return replace(problem, error_model=ERROR_MODELS[name])


def pcm(problem: HierarchicalProblem, *, drag: bool = False) -> Extension:
    law = load_law("pcm")
    if not drag:
        return extended(problem, law)
    shape = Shape(1700.0, 1850.0, None, None, ())
    direction = direction_of(mechanisms()["segment_drag"], setting_of(problem, law), shape)
    return extended(problem, law, [direction])


def draws(n: int, strength: tuple[float, float] | None = None, spread: float = 1.0) -> Draws:
    """Populations that differ, and a coefficient that is not well known either."""
    rng = np.random.default_rng(3)
    means = MEDIANS + spread * 0.3 * SPREADS * rng.standard_normal((n, 2))
    factors = spread * np.diag(SPREADS) * np.exp(0.2 * rng.standard_normal((n, 1, 1)))
    added = np.empty((n, 0)) if strength is None else rng.normal(*strength, (n, 1))
    return Draws(means, factors, added)


def predicted(extension: Extension, of: Draws, seed: int = 0) -> Conditional:
    return conditional([LeftOut(extension, of)] * extension.problem.campaign.n_events, seed)


@pytest.mark.parametrize("drag", [False, True])
def test_predictions_are_those_of_brute_force(ryggfonn: HierarchicalProblem, drag: bool) -> None:
    """The population drawn 600 times as often, weighed by densities of scipy."""
    problem = with_errors(ryggfonn, "normal")
    extension, of = pcm(problem, drag=drag), draws(300, (0.002, 0.0005) if drag else None)
    event, n = list(problem.campaign.event_ids).index("19850213"), 180_000
    rng, readings = np.random.default_rng(4), problem.readings
    many = of.take(np.resize(np.arange(300), n))
    logs = many.means + np.einsum("nij,nj->ni", many.factors, rng.standard_normal((n, 2)))
    points = np.column_stack([logs, rng.standard_normal(n)])
    fronts = extension.predict(np.full(n, event), points, many.strengths)
    sd = readings.sd(event, fronts[:, :-1])
    density = norm.logpdf(readings.values[event], fronts[:, :-1], sd)
    came = [norm.logcdf((fronts[:, -1] - place) / problem.place_sd_m) for place in (1650.0, 1810.0)]
    noisy = fronts[:, :-1] + sd * rng.standard_normal(sd.shape)
    found = predicted(extension, of)
    for sensor, given, also in (
        (LC, np.zeros(n), density[:, LC] + came[0]),
        (CD, density[:, LC] + came[0], density[:, CD] + came[1] - came[0]),
    ):
        weights = np.exp(given - given.max())
        weights /= weights.sum()
        x, order = noisy[:, sensor], np.argsort(noisy[:, sensor])
        at = np.cumsum(weights[order])
        low, high = x[order][np.searchsorted(at, [0.05, 0.95])]
        mean, spread = weights @ x, np.sqrt(weights @ (x - weights @ x) ** 2)
        assert abs(found.mean[event, sensor] - mean) < 0.1 * spread
        assert_allclose(
            [found.low[event, sensor], found.high[event, sensor]], [low, high], atol=0.25 * spread
        )
        score = np.log(np.sum(weights * np.exp(also)))
        assert found.log_score[event, sensor] == pytest.approx(score, abs=0.1)
        value, other = readings.values[event, sensor], rng.choice(x, n, p=weights)
        crps = weights @ np.abs(x - value) - 0.5 * np.abs(other - rng.permutation(other)).mean()
        assert found.crps[event, sensor] == pytest.approx(crps, abs=0.1 * spread)


@pytest.mark.parametrize("drag", [False, True])
def test_scores_of_an_avalanche_add_up_to_its_own(ryggfonn: HierarchicalProblem, drag: bool) -> None:
    """The chain rule, against the quadrature that scores avalanches as a whole."""
    extension, of = pcm(ryggfonn, drag=drag), draws(200, (0.002, 0.0005) if drag else None)
    found = predicted(extension, of)
    densities = log_densities(extension, campaign_rows(extension), of, 0)
    whole = np.logaddexp.reduce(densities, axis=0) - np.log(len(densities))
    # Not where an avalanche is known not to have come: that is no reading.
    every = (ryggfonn.campaign.status != Status.NOT_REACHED).all(axis=1) & (whole > -25.0)
    assert every.sum() > 12
    assert_allclose(np.nansum(found.log_score, axis=1)[every], whole[every], atol=0.35)


def test_a_common_error_is_known_from_above(ryggfonn: HierarchicalProblem) -> None:
    """Avalanches all alike, errors half in common: the next reading is normal in closed form."""
    problem = with_errors(ryggfonn, "correlated")
    extension, of = pcm(problem), draws(300, spread=1e-3)
    event = list(problem.campaign.event_ids).index("19930327")
    found = predicted(extension, of)
    point = np.append(of.means.mean(axis=0), 0.0)[None]
    front = extension.predict(np.array([event]), point, np.empty((1, 0)))[:, :-1]
    sd, values = problem.readings.sd(event, front)[0], problem.readings.values[event]
    z = (values[LC] - front[0, LC]) / sd[LC]
    assert abs(z) > 1.0
    mean, spread = front[0, CD] + 0.5 * z * sd[CD], np.sqrt(0.75) * sd[CD]
    assert found.mean[event, CD] == pytest.approx(mean, abs=0.15 * spread)
    low, high = norm.ppf([0.05, 0.95], mean, spread)
    assert_allclose([found.low[event, CD], found.high[event, CD]], [low, high], atol=0.2 * spread)
    assert found.log_score[event, CD] == pytest.approx(norm.logpdf(values[CD], mean, spread), abs=0.05)


def test_what_lies_above(ryggfonn: HierarchicalProblem) -> None:
    assert_array_equal(above(ryggfonn)[LC], False)
    assert_array_equal(above(ryggfonn)[B], [True, True, False, False])
    assert_array_equal(above(ryggfonn)[RUNOUT], [True, True, True, False])


def test_a_span_that_overlaps_is_not_above(ryggfonn: HierarchicalProblem) -> None:
    campaign = ryggfonn.campaign
    span = replace(campaign.sensors[LC], s_from_m=1600.0, s_to_m=1850.0)
    problem = hierarchical_problem(replace(campaign, sensors=(span, *campaign.sensors[1:])))
    assert not above(problem)[CD].any()
    assert_array_equal(above(problem)[B], [True, True, False, False])


def changed(campaign: Campaign, sensor: int) -> Campaign:
    values = np.array(campaign.values)
    values[:, sensor] *= 0.9
    return replace(campaign, values=values)


def test_readings_below_have_no_say(ryggfonn: HierarchicalProblem) -> None:
    """Another reading at b changes what is predicted of speeds only by chance, and of runouts indeed."""
    of = draws(200)
    other = hierarchical_problem(changed(ryggfonn.campaign, B))
    first, second = predicted(pcm(ryggfonn), of), predicted(pcm(other), of)
    spread = first.high - first.low
    for sensor in (LC, CD, B):
        known = np.isfinite(first.mean[:, sensor]) & (
            np.minimum(first.effective, second.effective)[:, sensor] > 100
        )
        moved = np.abs(first.mean - second.mean)[known, sensor] / spread[known, sensor]
        assert moved.max() < 0.12
    known = first.n_above[:, RUNOUT] > 2
    assert np.abs(first.mean - second.mean)[known, RUNOUT].max() > 5.0


def test_a_bound_on_the_runout_has_no_say_in_speeds_above(ryggfonn: HierarchicalProblem) -> None:
    """It lies below: in what is known of the readings above there is none."""
    campaign = ryggfonn.campaign
    event = int(np.flatnonzero(ryggfonn.readings.observed[:, LC])[0])
    status, values = campaign.status.copy(), campaign.values.copy()
    status[event, RUNOUT], values[event, RUNOUT] = Status.AT_MOST, 1000.0
    bounded = hierarchical_problem(replace(campaign, status=status, values=values))
    assert bounded.readings.bounded[event, RUNOUT]
    readings = readings_of(bounded, event, np.zeros((1, campaign.n_sensors), dtype=bool))
    for front in (900.0, 1300.0):
        fronts = np.full((1, campaign.n_sensors), 20.0)
        fronts[0, RUNOUT] = front
        log_l = log_likelihoods(np.zeros(1, dtype=int), fronts, readings, bounded.error_model.errors)
        assert log_l[0] == 0.0


def test_seeds_are_fixed_and_few_draws_are_told(ryggfonn: HierarchicalProblem) -> None:
    first, again = (predicted(pcm(ryggfonn), draws(200)) for _ in range(2))
    for one, other in zip(vars(first).values(), vars(again).values(), strict=True):
        assert_array_equal(one, other)
    assert np.nanmin(first.effective) > 5.0


def found_of(pair: BeforeAfter, problem: HierarchicalProblem, *carried_by: str) -> Diagnosis:
    nothing: Any = (None,) * 9
    events = tuple(problem.campaign.event_ids)
    few = Few(carried_by, 3.0) if carried_by else None
    hangs_on = Influence("drag", 9.0, 4.0, events, np.full(len(events), 8.0), few, None, 3.0, ())
    return Diagnosis(problem, load_law("pcm"), *nothing, hangs_on, pair)


def test_nothing_is_gained_where_before_is_after(ryggfonn: HierarchicalProblem) -> None:
    one = predicted(pcm(ryggfonn), draws(200))
    document = conditional_document(found_of(BeforeAfter(one, one), ryggfonn, "19880315", "19890217"))
    assert document is not None
    assert [row["sensor"] for row in document["sensors"]] == ["CD", "b", "runout"]
    for row in document["sensors"]:
        assert row["gain"] == "nothing gained"
        assert row["all"]["rmse_diff"] == row["all"]["log_score_diff"] == row["all"]["crps_diff_2se"] == 0.0
    assert "no reading is clearly predicted better" in document["statement"]
    assert (
        "Practically unchanged: the speed at CD" in document["statement"]
        and "as before" in document["statement"]
    )
    alone, without = (
        document["statement"]
        .split("The avalanches that carry the answer, by themselves: ")[1]
        .split(". Without them, ")
    )
    assert alone.startswith("the speed at CD (error") and "log score 0.0 ± 0.0, 2 readings" in alone
    assert without.startswith("no reading is clearly predicted better") and "18 readings" in without
    assert document["sensors"][0]["carrying"]["n"] == 2 and document["sensors"][0]["others"]["n"] == 18
    assert document["sensors"][1]["carrying"] is None


def of_sensor(name: str, gain: float, n: int = 20) -> dict[str, Any]:
    scores = {
        "n": n, "rmse_before": 1.0, "rmse_after": 0.8, "rmse_diff": -0.2, "log_score_diff": gain / n,
        "log_score_diff_2se": 2.0 / n,
    }  # fmt: skip
    sets = {"all": scores, "carrying": None, "others": None}
    return {"sensor": name, "quantity": "front_velocity", "unit": "m s-1", **sets}


def test_of_many_sensors_the_gain_of_each_is_counted() -> None:
    gains = [9.0, 9.0, 0.5, 0.5, 0.5, -9.0]
    sensors = [of_sensor(f"v{k}", gain) for k, gain in enumerate(gains)]
    said = given_above({"sensors": sensors, "speeds": of_sensor("all", 10.5, n=120)}, (0, 0))
    assert "improves the prediction of the speeds at 6 sensors together" in said
    assert "Of these sensors by themselves: 2 better, 3 nothing gained, 1 worse." in said
    few = given_above({"sensors": sensors[:2], "speeds": of_sensor("all", 18.0, n=40)}, (0, 0))
    assert "by themselves" not in few


@pytest.mark.parametrize(("covered", "told"), [(90, False), (95, False), (100, True)])
def test_errors_stated_too_large_are_told(covered: int, told: bool) -> None:
    """Of 100 speeds all lie in their 90 % intervals by chance in one of 37 000 cases."""
    said = given_above({"sensors": [of_sensor("v", 9.0)], "speeds": of_sensor("all", 9.0)}, (100, covered))
    assert ("scatter less than their stated errors" in said) == told
    assert not told or "lie 100 of 100 speeds" in said


def test_stopped_fronts_do_not_make_errors_too_large(
    ryggfonn: HierarchicalProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nil lies in the interval of every front that stops: only speeds above it are counted."""
    pair = predicted(pcm(ryggfonn), draws(200))
    inside = replace(pair, low=np.full_like(pair.low, -np.inf), high=np.full_like(pair.high, np.inf))
    speeds = ryggfonn.values[(pair.n_above > 0) & ryggfonn.readings.is_velocity]
    told = list[tuple[int, int]]()
    monkeypatch.setattr(
        "skred.diagnosis.verdict.conditional.given_above", lambda _, moving: told.append(moving)
    )
    conditional_document(found_of(BeforeAfter(inside, inside), ryggfonn))
    assert told == [((speeds > 0.0).sum(),) * 2] and (speeds == 0.0).any()


def test_a_gain_counts_beyond_twice_its_standard_error(ryggfonn: HierarchicalProblem) -> None:
    """Scores made up: what they differ by, and its error, in closed form."""
    before = predicted(pcm(ryggfonn), draws(200))
    off = np.where(before.n_above > 0, before.mean - ryggfonn.values, np.nan)
    better = replace(before, mean=ryggfonn.values + 0.5 * off, log_score=before.log_score + 0.5)
    document = conditional_document(found_of(BeforeAfter(before, better), ryggfonn))
    assert document is not None
    row = document["sensors"][0]
    assert row["carrying"] is None and row["others"] == row["all"] and row["gain"] == "better"
    assert row["all"]["rmse_after"] == pytest.approx(0.5 * row["all"]["rmse_before"])
    assert row["all"]["log_score_diff"] == pytest.approx(0.5)
    assert row["all"]["log_score_diff_2se"] == pytest.approx(0.0, abs=1e-12)
    log_score = before.log_score[:, CD][before.n_above[:, CD] > 0]
    two_se = 2.0 * log_score.std(ddof=1) / np.sqrt(len(log_score))
    assert row["all"]["log_score_before_2se"] == pytest.approx(two_se)
    assert "improves the prediction of the speed at CD" in document["statement"]
    noisy = np.where(np.arange(len(off))[:, None] % 2 == 0, 3.0, -2.0)
    unclear = replace(better, log_score=before.log_score + noisy)
    document = conditional_document(found_of(BeforeAfter(before, unclear), ryggfonn))
    assert document is not None and "No clear gain: the speed at CD" in document["statement"]
    worse = conditional_document(found_of(BeforeAfter(better, before), ryggfonn))
    assert worse is not None and "Worse: the speed at CD" in worse["statement"]
