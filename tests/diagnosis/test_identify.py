"""What recordings can tell, by simulation: detection limits, more events, one more sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import base_of, first_events, trial, with_sensors
from scipy.stats import norm

from skred.campaign.parts import of_events
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns
from skred.diagnosis.detect.detectability import (
    LIMIT_Z,
    Detectability,
    extra_sensors,
    identify,
    limit_z,
    mean_power,
    places_of_a_sensor,
    told,
)
from skred.diagnosis.detect.detectability import with_sensors as with_more_sensors
from skred.diagnosis.detect.run import identify_document
from skred.diagnosis.detect.score_test import ScoreTest, placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, campaign_rows, look_around
from skred.diagnosis.evidence.extension import extended, setting_of
from skred.diagnosis.evidence.linear_mixed_model import efficient_scores, fit_population, mean_prior
from skred.inference.error_model import ERROR_MODELS
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.stretches import is_opposed

NONE = np.zeros(0)


@pytest.fixture(scope="module")
def base() -> Base:
    campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, 10)
    return base_of(with_sensors(campaign, [4, 10, 16, 22, 28, campaign.n_sensors - 1]), "constant", "normal")


@pytest.fixture(scope="module")
def table(base: Base) -> dict[str, Detectability]:
    score_test = ScoreTest(base)
    scores = score_test.scores(base.rows, base.fit.points, base.population)
    return {row.mechanism.id: row for row in told(score_test, scores)}


def typical(base: Base, name: str) -> PlacedMechanism:
    """The candidate of middling information, as the table takes it."""
    own = [c for c in placed_mechanisms(base.setting) if c.mechanism.id == name]
    extension = extended(base.problem, base.law, [c.direction for c in own])
    around = look_around(EventLikelihood(extension, base.rows, np.zeros(len(own))), base.fit.points)
    found = efficient_scores(around, base.rows, base.population, mean_prior(base.law))
    return own[int(np.argsort(found.own[0])[len(own) // 2])]


@pytest.mark.parametrize(
    "name",
    [
        "segment_drag",
        "sensor_bias",
        "release_offset",
        pytest.param(
            "turbulent_drag",
            marks=pytest.mark.xfail(
                strict=True,
                reason="found in 75 % of cases, not 90: null scores are centred at -0.34 (1.5 % kept)",
            ),
        ),
    ],
)
def test_detection_limit_by_simulation(base: Base, table: dict[str, Detectability], name: str) -> None:
    """Campaigns with the limit's strength: their refitted scores are 2.85 + 1.28 in the null's deviations."""
    chosen = typical(base, name)
    alone, with_it = extended(base.problem, base.law), extended(base.problem, base.law, [chosen.direction])
    n_groups, strength = 200, table[name].limit
    means = np.tile(base.population.mean, (n_groups, 1))
    factors = np.tile(np.linalg.cholesky(base.population.covariance), (n_groups, 1, 1))
    normal, found = replace(base.problem, error_model=ERROR_MODELS["normal"]), []
    simulated = extended(normal, base.law, [chosen.direction])
    for value in (0.0, strength):
        rng = np.random.default_rng(4)
        rows, points = bootstrap_campaigns(simulated, np.array([value]), means, factors, rng)
        rows = rows._replace(errors=base.problem.error_model.errors)
        start = Population(means.copy(), np.tile(base.population.covariance, (n_groups, 1, 1)))
        population, modes = fit_population(
            EventLikelihood(alone, rows, NONE), mean_prior(base.law), (start, points)
        )
        around = look_around(EventLikelihood(with_it, rows, np.zeros(1)), modes)
        scores = efficient_scores(around, rows, population, mean_prior(base.law))
        found.append((scores.score / np.sqrt(scores.own))[:, 0])
    null, effect = found
    assert abs(null.mean()) < 0.6 and 0.7 < null.std() < 1.35
    assert (effect.mean() - null.mean()) / null.std() == pytest.approx(LIMIT_Z + 1.2816, rel=0.15)
    assert np.mean(effect > LIMIT_Z) > 0.8  # stated: 0.9


def test_power_is_a_mean_over_the_prior(base: Base) -> None:
    """Drag is opposed with probability 0.3, however many shapes that is. Of a fiftieth of the information."""
    score_test = ScoreTest(base)
    scores = score_test.scores(base.rows, base.fit.points, base.population)
    scores = scores._replace(information=scores.information / 50.0)
    _, (information,), _ = score_test.of_candidates(scores)
    own = [k for k, one in enumerate(score_test.placed_mechanisms) if one.mechanism.id == "segment_drag"]
    shapes = [score_test.placed_mechanisms[k].shape for k in own]
    relevant = np.array([score_test.placed_mechanisms[k].relevant for k in own])
    found = norm.cdf(np.sqrt(information[own]) * relevant - limit_z(len(mechanisms())))
    opposed, weight = np.array([(is_opposed(one), one.prior_weight) for one in shapes]).T
    of_kinds = [np.average(found[of], weights=weight[of]) for of in (opposed > 0, opposed == 0)]
    assert abs(of_kinds[0] - of_kinds[1]) > 0.05 and abs((opposed > 0).mean() - 0.3) > 0.05
    (power,) = (row.power for row in told(score_test, scores) if row.mechanism.id == "segment_drag")
    assert power == pytest.approx(0.3 * of_kinds[0] + 0.7 * of_kinds[1], rel=1e-9)


def test_one_more_sensor_stands_on_the_track_and_below_the_release(base: Base) -> None:
    """Of a chute a few metres long, too."""
    release = float(base.problem.releases.mean.max())
    places = places_of_a_sensor(base.problem, (release + 0.5, release + 1.5))
    assert release < places[0] and (np.diff(places) > 0.0).all() and places[-1] == release + 1.5
    beyond = places_of_a_sensor(base.problem, (release + 0.5, base.problem.terrain.length_m + 10.0))
    assert beyond[-1] < base.problem.terrain.length_m


def test_that_nothing_is_looked_for_on_a_stretch_is_told(base: Base, table: dict[str, Detectability]) -> None:
    found = identify(base)
    of_sensors = replace(found, rows=(table["sensor_bias"], table["viscous_drag"]))
    said, less = (
        " ".join(identify_document(base.problem, base.law, one)["statement"]) for one in (found, of_sensors)
    )
    assert "shorter than the shortest stretch looked at (75 m)" in less
    assert "Nothing was looked for on a stretch" not in said


def test_one_more_sensor_is_as_good_as_readings_say_where_sensors_do_not(base: Base) -> None:
    """Each reading may have its own standard deviation, and the sensors none."""
    campaign = base.problem.campaign
    n = sum(not sensor.is_runout for sensor in campaign.sensors)
    sensors = tuple(
        one if one.is_runout else replace(one, relative_sd=0.0, absolute_sd=0.0) for one in campaign.sensors
    )
    stated = campaign.stated_sd.copy()
    stated[:, :n] = 1.5
    problem = replace(base.problem, campaign=replace(campaign, sensors=sensors, stated_sd=stated))
    own = base_of(problem.campaign, "constant", "normal")
    found = identify(own)
    assert np.isfinite([found.power, found.power_with, found.sensor_m]).all()
    assert found.power_with >= found.power
    added = with_more_sensors(problem, np.array([500.0])).campaign.sensors[-1]
    assert (added.relative_sd, added.absolute_sd) == (0.0, 1.5)


def test_more_events_tell_more(base: Base, table: dict[str, Detectability]) -> None:
    """Every event four times: limits halve, but for the population mean's prior."""
    campaign = base.problem.campaign
    four = of_events(campaign, list(range(campaign.n_events)) * 4)
    events = tuple(replace(event, id=f"{event.id} {k}") for k, event in enumerate(four.events))
    problem = replace(base.problem, campaign=replace(four, events=events))
    score_test = ScoreTest(replace(base, problem=problem, setting=setting_of(problem, base.law)))
    rows = campaign_rows(score_test.base.extended())
    scores = score_test.scores(rows, np.tile(base.fit.points, (4, 1)), base.population)
    for row in told(score_test, scores):
        before = table[row.mechanism.id]
        assert row.limit < before.limit
        assert row.limit / before.limit == pytest.approx(0.5, abs=0.06), row.mechanism.id
        assert row.power >= before.power - 1e-9


def test_a_relevant_strength_is_that_of_the_shape(base: Base) -> None:
    """Compensated drag has a wider prior: three times as much of it is relevant, and may be a limit."""
    [opposed, plain] = (
        next(
            one
            for one in ScoreTest(base).placed_mechanisms
            if one.mechanism.id == "segment_drag" and is_opposed(one.shape) == compensated
        )
        for compensated in (True, False)
    )
    assert opposed.relevant == pytest.approx(3.0 * plain.relevant) and opposed.scale == 3.0 * plain.scale
    assert plain.relevant == plain.added.relevant


def test_an_extra_sensor_never_tells_less(base: Base, table: dict[str, Detectability]) -> None:
    score_test = ScoreTest(base)
    places, scores = extra_sensors(base)
    before = {name: row for name, row in table.items()}
    power = mean_power(list(table.values()))
    assert len(places) == len(scores) and np.all(np.diff(places) > 0.0)
    for one in scores:
        rows = told(score_test, one)
        assert mean_power(rows) >= power - 1e-6
        for row in rows:
            assert row.power >= before[row.mechanism.id].power - 1e-6, row.mechanism.id
            assert row.best_limit <= before[row.mechanism.id].best_limit * (1.0 + 1e-6), row.mechanism.id


def test_table(base: Base, table: dict[str, Detectability]) -> None:
    """Each candidate once; limits positive; the best place never worse; ties mutual terms at least."""
    assert set(table) == {c.mechanism.id for c in placed_mechanisms(base.setting)}
    assert "constant_retardation" not in table  # in the base law
    for row in table.values():
        assert 0.0 <= row.kept <= 1.0 and 0.0 <= row.power <= 1.0
        assert 0.0 < row.best_limit <= row.limit
    assert "entrainment" in table["segment_drag"].alike and "segment_drag" in table["entrainment"].alike
