"""A sensor elsewhere: as in a campaign that notes it there; found, or allowed for by its stated error."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import norm

from skred.campaign import Campaign, Status
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.residue import Residue, residues
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.compare.sensor_places import shifts_beside, with_stated_places
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Profile
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at, curve_near
from skred.diagnosis.evidence.conditional_map import EventLikelihood, campaign_rows
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.moved_sensors import StopBounds
from skred.inference.error_model import FrontsSeen
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import PlacedMechanism, placed, shapes_of
from skred.physics.mechanisms.spec import Shape
from tests.diagnosis.diagnosis_cases import base_of, trial

DRAG, PLACE = mechanisms()["turbulent_drag"], mechanisms()["sensor_place"]
HIDDEN = "v02"


@pytest.fixture(scope="module")
def base() -> Base:
    """Mean speeds over spans, the second of them 41 m further up than noted; some fronts stop between two."""
    return base_of(trial(9103, "sparse", "sensor_place", "coulomb", 10.0).campaign, "coulomb")


def elsewhere(campaign: Campaign, sensor: str, by_m: float) -> Campaign:
    """A campaign that notes one sensor so much further down."""
    moved = [
        replace(one, s_from_m=one.s_from_m + by_m, s_to_m=one.s_to_m + by_m) if one.id == sensor else one
        for one in campaign.sensors
    ]
    return replace(campaign, sensors=tuple(moved))


@pytest.mark.parametrize(("sensor", "by_m"), [("v02", -30.0), ("v02", 35.0), ("v03", -25.0), ("v01", 40.0)])
def test_likelihoods_are_those_of_a_campaign_that_notes_it_there(
    base: Base, sensor: str, by_m: float
) -> None:
    """Exactly where one sensor alone tells of a stop; about as well where a front stopped between two."""
    campaign = base.problem.campaign
    points = base.fit.points + 0.05 * np.random.default_rng(3).standard_normal(base.fit.points.shape)
    direction = placed(PLACE, base.setting, Shape(sensor=sensor)).direction
    moved = EventLikelihood(base.extended(direction), base.rows, np.array([by_m]))
    problem = hierarchical_problem(elsewhere(campaign, sensor, by_m))
    there = extended(replace(problem, error_model=base.problem.error_model), load_law("coulomb"))
    noted = EventLikelihood(there, campaign_rows(there), np.zeros(0))
    readings = moved.predict(points), noted.predict(points)
    np.testing.assert_allclose(readings[0][:, :-1], readings[1][:, :-1], rtol=1e-9)
    stops = np.abs(readings[0][:, -1] - readings[1][:, -1])
    assert stops.max() > 1.0 or sensor == "v01"  # no front is known to have stopped by the uppermost one
    unmoved = EventLikelihood(base.extended(), base.rows, np.zeros(0)).at(points) - noted.at(points)
    errors = moved.at(points) - noted.at(points)
    both = (campaign.status == Status.NOT_REACHED).any(axis=1)
    np.testing.assert_allclose(errors[~both], 0.0, atol=1e-5)
    assert np.abs(errors[both]).max() < 0.5 and np.median(np.abs(errors[both])) < 0.05
    assert np.abs(unmoved).max() > 1.0


def test_a_stop_is_as_far_from_the_noted_place_as_from_the_sensor() -> None:
    came, stayed = np.array([[True, False], [True, False]]), np.array([[False, True], [False, False]])
    places = np.array([100.0, 200.0])
    fronts = FrontsSeen(came, stayed, np.zeros_like(came), np.full(2, np.inf), places, places)
    bounds = StopBounds(fronts, 1000.0)
    stops, shifts = np.array([90.0, 125.0, 260.0]), np.tile([-10.0, 20.0], (3, 1))
    seen, slope = bounds.as_noted(stops, np.zeros(3, dtype=int), shifts)
    np.testing.assert_allclose(seen, [100.0, 100.0 + 35.0 * 100.0 / 130.0, 240.0])
    np.testing.assert_allclose(slope, [1.0, 100.0 / 130.0, 1.0])
    seen, slope = bounds.as_noted(stops, np.ones(3, dtype=int), shifts)
    np.testing.assert_allclose(seen, stops + 10.0, atol=1e-3)
    np.testing.assert_allclose(slope, 1.0, atol=1e-4)


def test_another_sensor_may_tell_of_the_stop_once_one_is_moved() -> None:
    places = np.array([100.0, 120.0])
    none = np.zeros((1, 2), dtype=bool)
    bounds = StopBounds(FrontsSeen(~none, none, none, np.array([np.inf]), places, places), 1e3)
    lowest, _ = bounds.between(np.zeros(2, dtype=int), np.array([[0.0, -50.0], [90.0, 0.0]]))
    assert lowest.tolist() == [100.0, 190.0]


def test_a_span_is_moved_as_a_whole_up_to_the_end_of_the_track() -> None:
    """As the kernel moves it: here by ten metres of sixty, and its front was read up to its stop."""
    came, none = np.ones((1, 1), dtype=bool), np.zeros((1, 1), dtype=bool)
    fronts = FrontsSeen(came, none, none, np.array([995.0]), np.array([900.0]), np.array([990.0]))
    lowest, _ = StopBounds(fronts, 1000.0).between(np.zeros(1, dtype=int), np.array([[60.0]]))
    assert lowest.tolist() == [910.0]


def test_it_is_found_where_it_is(base: Base) -> None:
    """Closer to the truth than a factor of its readings comes, and than a shift of any other sensor."""
    assert (base.problem.campaign.status == Status.NOT_REACHED).any()
    strengths = np.array([-60.0, -50.0, -40.0, -30.0, -20.0, -10.0, 10.0])
    curves = {
        name: curve_at(base, placed(PLACE, base.setting, Shape(sensor=name)), strengths)
        for name in ("v01", "v02", "v03")
    }
    bias = placed(mechanisms()["sensor_bias"], base.setting, Shape(sensor=HIDDEN))
    factor = curve_at(base, bias, np.array([0.05, 0.1, 0.13, 0.16, 0.19, 0.22]))
    mean, sd = curves[HIDDEN].moments
    assert abs(mean + 40.6) < 2.0 * sd and sd < 8.0
    others = [factor.log_bayes_factor, *(curves[name].log_bayes_factor for name in ("v01", "v03"))]
    assert curves[HIDDEN].log_bayes_factor > max(others) + 1.0


def stated(base: Base, sd_m: float, sensor: str = HIDDEN) -> Base:
    """The base on the same recordings, the place of one sensor known to so many metres."""
    campaign = base.problem.campaign
    sensors = tuple(replace(one, place_sd_m=sd_m) if one.id == sensor else one for one in campaign.sensors)
    problem = replace(base.problem, campaign=replace(campaign, sensors=sensors))
    return replace(base, problem=problem)


def test_stated_places_are_integrated_over_as_by_campaigns_that_note_them_elsewhere(base: Base) -> None:
    """By the trapezium rule over refits of such campaigns, which know nothing of moved sensors."""
    sd, step = 25.0, 5.0
    shifts_m = np.arange(-70.0, -9.0, step)
    heights = [
        base_of(elsewhere(base.problem.campaign, HIDDEN, shift), "coulomb").fit.found.log_evidence
        for shift in shifts_m
    ]
    expected = np.logaddexp.reduce(np.array(heights) + norm.logpdf(shifts_m, scale=sd) + np.log(step))
    expected -= base.with_nothing(USUAL).found.log_evidence
    shifts = shifts_beside(stated(base, sd))
    assert not shifts_beside(base).places.errors
    assert expected > 30.0 and shifts.log_factor == pytest.approx(expected, abs=1.0)
    weights = np.exp(np.array(heights) - max(heights) + norm.logpdf(shifts_m, scale=sd))
    mean = np.average(shifts_m, weights=weights)
    spread = np.sqrt(np.average((shifts_m - mean) ** 2, weights=weights))
    assert shifts.mean == pytest.approx([mean], abs=0.3 * spread)
    assert shifts.sd == pytest.approx([spread], rel=0.2)


def test_of_several_sensors_the_one_that_is_off_is_found(base: Base) -> None:
    everywhere = base
    for name in ("v01", "v02", "v03"):
        everywhere = stated(everywhere, 40.0, name)
    alone, together = shifts_beside(stated(base, 40.0)), shifts_beside(everywhere)
    assert together.log_factor == pytest.approx(alone.log_factor, abs=6.0)  # two more take a little
    assert np.all(np.abs(together.mean - [0.0, -40.6, 0.0]) < 2.0 * together.sd)


def test_a_shift_that_stated_places_allow_for_is_no_finding(base: Base) -> None:
    """A fault and a stated error of one place are one shift, with both their variances."""
    strengths = np.append(np.arange(-70.0, 0.0, 5.0), 10.0)
    found = curve_at(base, placed(PLACE, base.setting, Shape(sensor=HIDDEN)), strengths)
    candidates = {PLACE.id: Candidate(PLACE, (found,), np.zeros(1))}
    before = candidates[PLACE.id].log_bayes_factor
    assert before > 40.0
    with ThreadPoolExecutor(1) as pool:
        for sd in (10.0, 20.0, 40.0):
            changed, _, nothing = with_stated_places(stated(base, sd), candidates, [], [], pool)
            of_error, of_both = (
                found.log_factor_of(scales=(one / found.scale,)) for one in (sd, np.hypot(sd, found.scale))
            )
            assert nothing.log_factor == pytest.approx(of_error, abs=1.0)
            assert changed[PLACE.id].log_bayes_factor == pytest.approx(of_both - of_error, abs=1.0)
        assert changed[PLACE.id].log_bayes_factor < 1.0
        same, _, none = with_stated_places(base, candidates, [], [], pool)
    assert none.log_factor == 0.0 and same[PLACE.id].log_bayes_factor == before


def test_what_only_makes_up_for_a_shift_has_no_more_than_where_the_sensor_stands_as_noted(
    base: Base, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A force takes most of the shift as its own; drag would have to be below nil for it.

    And what threads compute asks for no other kind of array: another thread may have loaded half of it.
    """
    there = base_of(elsewhere(base.problem.campaign, HIDDEN, -40.6), "coulomb")
    monkeypatch.setitem(sys.modules, "jax", ModuleType("jax"))
    found, expected = [
        (curve(one, placed(DRAG, one.setting, Shape())), fit_profile(one, KINDS[0])) for one in (base, there)
    ]
    assert found[1].log_bayes_factor > 40.0
    candidates = {DRAG.id: Candidate(DRAG, (found[0],), np.zeros(1))}
    with ThreadPoolExecutor(1) as pool:
        changed, [force], _ = with_stated_places(stated(base, 40.0), candidates, [found[1]], [found[1]], pool)
    assert changed[DRAG.id].log_bayes_factor == pytest.approx(expected[0].log_bayes_factor, abs=1.0)
    assert force.log_bayes_factor == pytest.approx(expected[1].log_bayes_factor, abs=1.0)


@pytest.mark.parametrize("id_", ["viscous_drag", "velocity_weakening"])
def test_a_place_known_to_a_centimetre_changes_nothing(id_: str) -> None:
    """Whether a mechanism's best strength is above nil or it has less evidence the more there is of it."""
    clean = base_of(trial(9301, "sparse", "nothing", "coulomb", 0.0).campaign, "coulomb")
    mechanism = mechanisms()[id_]
    found = curve(clean, placed(mechanism, clean.setting, shapes_of(mechanism, clean.setting)[0]))
    assert found.log_bayes_factor < -1.0
    candidates = {id_: Candidate(mechanism, (found,), np.zeros(1))}
    with ThreadPoolExecutor(1) as pool:
        changed, _, _ = with_stated_places(stated(clean, 0.01), candidates, [], [], pool)
    assert (changed[id_].strength_with_places is None) == (id_ == "velocity_weakening")
    assert changed[id_].of_places == pytest.approx(0.0, abs=0.05)


@pytest.mark.slow
def test_a_span_that_is_noted_to_end_below_a_sensor_that_its_fronts_did_not_reach() -> None:
    """As if they had come there and had not: integrated over its place, all is as by campaigns that note it.

    Drag is not there, and has more with the span 8 m above where it stands.
    """
    campaign = trial(9302, "sparse", "segment_friction", "coulomb", 10.0).campaign
    elsewhere_noted = elsewhere(campaign, HIDDEN, 40.0)
    assert elsewhere_noted.sensors[1].s_to_m > elsewhere_noted.sensors[2].s_to_m
    there, noted = (base_of(one, "coulomb", "scaled") for one in (campaign, elsewhere_noted))
    best, candidates = list[PlacedMechanism](), dict[str, Candidate]()
    for id_ in ("segment_friction", "velocity_weakening", "turbulent_drag"):
        mechanism = mechanisms()[id_]
        every = [placed(mechanism, there.setting, shape) for shape in shapes_of(mechanism, there.setting)]
        best.append(max(every, key=lambda one: curve(there, one).log_bayes_factor))
        one = curve(noted, placed(mechanism, noted.setting, best[-1].shape))
        candidates[id_] = Candidate(mechanism, (one,), np.zeros(1))

    shifts_m, heights = np.arange(-64.0, -23.0, 3.0), list[list[float]]()
    for shift in shifts_m:
        base = base_of(elsewhere(campaign, HIDDEN, 40.0 + shift), "coulomb", "scaled")
        added = [placed(one.mechanism, base.setting, one.shape) for one in best]
        factors = [0.0, *(curve(base, one).log_bayes_factor for one in added)]
        factors.append(fit_profile(base, KINDS[0]).log_bayes_factor)
        heights.append([base.with_nothing(USUAL).found.log_evidence + one for one in factors])
    weights = norm.logpdf(shifts_m, scale=40.0)[:, None]
    nothing, *expected, expected_force = np.logaddexp.reduce(np.array(heights) + weights, axis=0)

    profile = fit_profile(noted, KINDS[0])
    with ThreadPoolExecutor(1) as pool:
        found, [force], shifts = with_stated_places(
            stated(noted, 40.0), candidates, [profile], [profile], pool
        )
    assert shifts.mean == pytest.approx([-40.0], abs=2.0 * shifts.sd[0])
    assert [one.alone for one in found.values()] == pytest.approx(np.array(expected) - nothing, abs=1.0)
    assert force.log_bayes_factor == pytest.approx(expected_force - nothing, abs=1.5)
    assert expected[0] - nothing > 15.0


@pytest.mark.slow
def test_a_mechanism_beside_a_shift_is_integrated_over_as_by_campaigns_that_note_it_elsewhere() -> None:
    """Drag and a sensor that stands 40 m above its place; alone, a force in its place, and both.

    Where the sensor is noted the force has something to do beside drag; integrated over places it has not.
    """
    campaign = trial(9303, "sparse", "viscous_drag", "constant", 10.0).campaign
    drag = mechanisms()["viscous_drag"]

    def compared(base: Base) -> tuple[Curve, Residue, Profile]:
        found = curve(base, placed(drag, base.setting, Shape()))
        found = curve_near(base, found, found.shape)
        [beside] = residues(base, [found], [-1e3], pool)
        assert beside is not None
        return found, beside, fit_profile(base, KINDS[0])

    sd, step, heights, means = 40.0, 15.0, list[list[float]](), list[float]()
    shifts_m = np.arange(-90.0, 46.0, step)
    with ThreadPoolExecutor(2) as pool:
        for shift in shifts_m:
            base = base_of(elsewhere(campaign, HIDDEN, 40.0 + shift), "constant")
            alone, beside, force = compared(base)
            factor = alone.log_bayes_factor
            factors = [0.0, factor, factor + beside.log_factor, force.log_bayes_factor]
            means.append(alone.moments[0])
            heights.append([base.with_nothing(USUAL).found.log_evidence + one for one in factors])
        weights = norm.logpdf(shifts_m, scale=sd) + np.log(step)
        nothing, *expected = np.logaddexp.reduce(np.array(heights) + weights[:, None], axis=0)
        base = base_of(elsewhere(campaign, HIDDEN, 40.0), "constant")
        alone, beside, force = compared(base)
        assert beside.log_factor > 2.0
        one = Candidate(drag, (alone,), np.zeros(1), residue=beside.log_factor, beside=beside.beside)
        found, [force], _ = with_stated_places(stated(base, sd), {drag.id: one}, [force], [force], pool)
    changed = found[drag.id]
    assert changed.residue is not None and changed.residue < 0.0
    assert changed.alone == pytest.approx(expected[0] - nothing, abs=1.0)
    assert changed.alone + changed.residue == pytest.approx(expected[1] - nothing, abs=1.5)
    assert force.log_bayes_factor == pytest.approx(expected[2] - nothing, abs=1.0)
    # Its strength is what the campaigns have, each as much as with the mechanism it has evidence.
    share = np.exp(np.array([row[1] for row in heights]) + weights - expected[0])
    mean = float(share @ means)
    strength = changed.strength_with_places
    assert strength is not None and strength.mean == pytest.approx(mean, rel=0.1)
    assert alone.moments[0] < 0.8 * mean  # with the place taken as exact


def test_what_recordings_can_tell_is_less_where_places_are_uncertain(base: Base) -> None:
    """Of the shift itself by the closed form of two normal errors, of nothing more than before."""
    of, kept = ScoreTest(base).placed_mechanisms, list[np.ndarray]()
    for one in (base, stated(base, 20.0), stated(base, 1e-3)):
        test = ScoreTest(one)
        scores = test.scores(base.rows, base.fit.points, base.population)
        kept.append(test.of_candidates(scores)[1][0])
    exact, uncertain, nearly = kept
    np.testing.assert_allclose(nearly, exact, rtol=1e-4)
    [own] = [k for k, one in enumerate(of) if one.mechanism is PLACE and one.shape.sensor == HIDDEN]
    assert uncertain[own] == pytest.approx(1.0 / (1.0 / exact[own] + 20.0**2))
    assert np.all(uncertain <= exact * (1.0 + 1e-9)) and np.median(uncertain / exact) < 1.0
