"""Where the comparison leans to something and the check does not fire, the statement says both."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_report_cases import comparison_of, diagnosis, document_of, with_finding
from numpy.typing import NDArray

from skred.diagnosis.augment.coefficient import strength_of
from skred.diagnosis.augment.step import Left, NotAugmented
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.check.decision import Decision
from skred.diagnosis.compare.candidate import BESIDE, FORM, Candidate, Strength
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.sensor_places import Shifts
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.diagnosis.evidence.refit import Fit, unfitted
from skred.diagnosis.evidence.stated_places import StatedPlaces
from skred.diagnosis.influence.influence import Few, ReadingsLeftOut, Rival
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.verdict.document import verdict
from skred.diagnosis.verdict.figure_data import figure_data
from skred.diagnosis.verdict.hangs_on import hangs_on
from skred.diagnosis.verdict.next_sensor import next_sensor
from skred.diagnosis.verdict.statement import statement
from skred.diagnosis.words import error_texts, percent, plus_minus
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import Direction, Setting, Shape
from skred.physics.mechanisms.stretches import U_1, U_2
from skred.report.diagnosis.lay import lay_words
from skred.report.diagnosis.report import render_diagnosis
from skred.report.diagnosis.words import short_title
from skred.report.shared.draws import chains_of

FloatArray = NDArray[np.float64]


def document(probability: dict[str, float]) -> dict:
    return {"probability": probability, "next_sensor": None}


@pytest.mark.parametrize("kind", ["nothing", "silent"])
def test_a_lean_that_the_check_does_not_bear_out_is_told_and_not_claimed(kind: str) -> None:
    found = replace(diagnosis(kind), decision=Decision("cannot_tell", ()))
    leaning = statement(found, document({"nothing": 0.08, "obstacle": 0.62, "unlisted": 0.3}))
    assert f"{100.0 * found.table.power:.0f} % of cases" in leaning
    assert ("no silence either" in leaning) == found.table.can_tell == (kind == "nothing")
    assert ("so silence means little" in leaning) == (kind == "silent")
    assert "an obstacle would be the most probable (62 %)" in leaning
    above, of = int(np.sum(found.check.simulated >= found.check.statistic)), len(found.check.simulated)
    assert above > 1 and f"None is claimed: {above} of {of} clean campaigns have such odds" in leaning
    differ = replace(found, check=BootstrapTest(2.0, np.zeros(9)))
    told = statement(differ, document({"nothing": 0.08, "obstacle": 0.62, "unlisted": 0.3}))
    assert "with a strength in common to all avalanches the log odds are only 2.0 nats" in told
    kept = statement(found, document({"nothing": 0.2, "obstacle": 0.5, "unlisted": 0.3}))
    assert "None is claimed: nothing keeps 20 %, and a claim leaves it less than 10 %" in kept
    assert "clean campaigns" not in kept
    other = statement(found, document({"nothing": 0.2, "obstacle": 0.3, "unlisted": 0.5}))
    assert "a force not in the list would be" in other
    plain = statement(found, document({"nothing": 0.6, "obstacle": 0.3, "unlisted": 0.1}))
    assert "would be the most probable" not in plain


def test_what_a_last_comparison_leaned_to_is_told() -> None:
    """Also that it was not added, and why; and nothing where it leaned to nothing, or was not run."""
    found = diagnosis("tie")
    assert verdict(found)["left"] is None and "Another comparison" not in verdict(found)["statement"]
    leaning = with_finding(found, left=Left(diagnosis("two").comparison, "the gate failed"))
    document = verdict(leaning)
    assert document["left"]["most_probable"] == "covariate_friction"
    assert document["left"]["nothing"] == leaning.left.comparison.probability["nothing"]
    assert document["left"]["covariate"] and document["left"]["sensor"] is None
    assert f"({document['left']['covariate']}) as the most probable" in document["statement"]
    assert "has friction that goes with a property" in document["statement"]
    assert "it was not added (the gate failed)" in document["statement"]
    shares = {"nothing": 0.4, "obstacle": 0.25, "unlisted": 0.35}
    made = leaning.left.comparison
    unsure = type("Unsure", (Comparison,), {"probability": shares})(**vars(made))
    told = verdict(with_finding(found, left=Left(unsure, "no alarm, p = 0.1")))
    assert told["left"]["most_probable"] == "unlisted"
    assert "(nothing more: 40 %); it was not added (no alarm, p = 0.1)." in told["statement"]
    nothing = verdict(with_finding(found, left=Left(diagnosis("nothing").comparison)))
    assert nothing["left"]["most_probable"] == "nothing" and "Another comparison" not in nothing["statement"]


@pytest.mark.parametrize(
    ("sign", "said"), [(1.0, "slower fronts are accelerated"), (-1.0, "slower fronts are decelerated")]
)
def test_which_fronts_an_unlisted_force_decelerates(sign: float, said: str) -> None:
    found = diagnosis("unexplained")
    plain = verdict(found)["statement"]
    assert "The mean front is unaffected" not in plain and "comes closest (" in plain
    location = replace(found.location, opposed=True, mean=sign * found.location.mean)
    assert said in verdict(replace(found, location=location))["statement"]


def test_that_a_named_drag_is_compensated_is_told() -> None:
    """In the statement and in the equation, with the speeds at which they are equal."""
    found = diagnosis("tie")
    assert "compensated" not in verdict(found)["statement"]
    candidate = found.steps[0].candidate
    curves = tuple(
        replace(one, shape=replace(one.shape, constants=((U_1, 31.0), (U_2, 24.0))))
        for one in candidate.curves
    )
    step = replace(found.steps[0], candidate=replace(candidate, curves=curves))
    document = verdict(with_finding(found, steps=(step,)))
    assert "it is compensated at about the typical speed (31 to 24 m/s)" in document["statement"]
    assert "(U^2 - U_0^2)" in document["equation"] and document["mechanisms"][0]["constants"][U_1] == 31.0


def placed_about(found: Diagnosis, place_sd_m: float) -> str:
    """The statement where fronts have 20 m/s at the first sensor and lose 1 m/s in 10 m there."""
    setting = setting_of(found.problem, found.law)
    first, *others = found.problem.campaign.sensors
    at = 0.5 * (first.s_from_m + first.s_to_m)
    speed = np.maximum(20.0 - 0.1 * (setting.terrain.edge_s_m - at), 0.0)
    sensors = (replace(first, place_sd_m=place_sd_m), *others)
    problem = replace(found.problem, campaign=replace(found.problem.campaign, sensors=sensors))
    under, *rest = found.comparison.under_each
    under = replace(under, base=SimpleNamespace(setting=replace(setting, front_speed=speed)))
    comparison = replace(found.comparison, under_each=(under, *rest))
    return statement(replace(found, problem=problem, comparison=comparison), verdict(found))


@pytest.mark.parametrize(("kind", "claimed"), [("tie", True), ("unexplained", True), ("nothing", False)])
def test_what_a_sensor_would_read_elsewhere_is_told_where_something_is_claimed(
    kind: str, claimed: bool
) -> None:
    """10 % otherwise 20 m off; 2 m off it is less than what errors of its readings leave open."""
    found = diagnosis(kind)
    assert "its calibration takes places" not in verdict(found)["statement"]
    said, sensor = placed_about(found, 20.0), found.problem.campaign.sensor_ids[0]
    words = f"{sensor}, whose place is known to 20 m (sd), would read 10 % faster or slower so far up or down"
    assert (words in said) is claimed and ("its calibration takes places" in said) is claimed
    assert "its calibration takes places" not in placed_about(found, 2.0)


def test_which_way_a_sensor_stands_elsewhere_is_told() -> None:
    found = diagnosis("sensor_place")
    candidate, sensors = found.steps[0].candidate, found.problem.campaign.sensor_ids
    places = np.array([float(name == candidate.best.shape.sensor) for name in sensors])
    curves = tuple(replace(one, direction=Direction(places=places)) for one in candidate.curves)
    step = replace(found.steps[0], candidate=replace(candidate, curves=curves))
    assert "m: it stands further down than noted" in verdict(with_finding(found, steps=(step,)))["statement"]


def test_sensors_that_stand_elsewhere_as_their_stated_errors_allow_are_told() -> None:
    """With where they stand, where nothing is claimed; none that may as well stand as noted."""
    found, claimed = diagnosis("nothing"), diagnosis("sensor")
    assert verdict(found)["sensor_places"] is None and "Stated errors" not in verdict(found)["statement"]
    places = StatedPlaces((("LC", 40.0), ("CD", 20.0)))
    fit = Fit(unfitted(Population(np.zeros((1, 2)), np.eye(2)[None])), np.zeros((22, 3)))  # none is told of

    def about(one: Diagnosis, log_factor: float) -> dict[str, object]:
        under, *rest = one.comparison.under_each
        mean, sd = np.array([-31.0, 3.0]), np.array([9.5, 12.0])
        shifts = Shifts(places, mean, sd, log_factor, fit)
        comparison = replace(one.comparison, under_each=(replace(under, shifts=shifts), *rest))
        return verdict(replace(one, comparison=comparison))

    document = about(found, 14.2)
    assert "LC probably stands 31.0 ± 9.5 m further up than noted (log" in document["statement"]
    assert "CD probably" not in document["statement"] and "14.2 nats" in document["statement"]
    assert document["sensor_places"]["log_bayes_factor"] == 14.2
    assert [one["sensor"] for one in document["sensor_places"]["sensors"]] == ["LC", "CD"]
    for little in (about(found, 2.0), about(claimed, 14.2)):
        assert "probably stands" not in little["statement"] and little["sensor_places"] is not None


def test_a_strength_is_told_with_the_places_of_sensors_fitted_as_well() -> None:
    found = diagnosis("tie")
    (step,) = found.steps
    assert "where sensors stand" not in verdict(found)["statement"]
    candidate = replace(step.candidate, strength_with_places=Strength(1.25, 0.5))
    under, *rest = found.comparison.under_each
    candidates = under.candidates | {candidate.mechanism.id: candidate}
    comparison = replace(found.comparison, under_each=(replace(under, candidates=candidates), *rest))
    document = verdict(
        with_finding(
            replace(found, comparison=comparison),
            steps=(replace(step, candidate=candidate, comparison=comparison),),
        )
    )
    size = plus_minus(1.25, 0.5, candidate.mechanism.strength.unit)
    assert f"as their stated errors allow, it is {size}." in document["statement"]
    [row] = [one for one in document["candidates"] if one["id"] == candidate.mechanism.id]
    assert row["strength_with_places"] == {"mean": 1.25, "sd": 0.5}


def test_how_probably_what_is_named_begins_at_the_first_recording_is_told() -> None:
    found = diagnosis("tie")
    (step,) = found.steps
    curves = tuple(replace(one, shape=Shape()) for one in step.candidate.curves)
    before = replace(step, candidate=replace(step.candidate, curves=curves))
    assert "else along the whole track" not in verdict(with_finding(found, steps=(before,)))["statement"]
    best = int(np.argmax([one.log_bayes_factor for one in curves]))
    later = tuple(
        replace(one, shape=Shape(s_from_m=1100.0)) if k == best else one for k, one in enumerate(curves)
    )
    after = replace(step, candidate=replace(step.candidate, curves=later))
    document = verdict(with_finding(found, steps=(after,)))
    share = percent(float(after.candidate.shape_weights[best]))
    told = f"With a probability of {share} it acts only from s = 1100 m on, where recordings begin;"
    assert told in document["statement"]
    assert document["location"] is None and document["equation"].endswith("for s > 1100 m")


def fitted(candidate: Candidate, setting: Setting, points: FloatArray) -> Candidate:
    """With what its curves change on the track, and the events' modes at each of their strengths."""
    curves = tuple(
        replace(
            one,
            direction=direction_of(one.mechanism, setting, one.shape),
            fits=(Fit(None, points),) * len(one.strengths),
        )
        for one in candidate.curves
    )
    return replace(candidate, curves=curves)


def tied_with_a_dam() -> Diagnosis:
    """A sensor's bias is named; an obstacle and a force in no list are tied with it."""
    found, tied = diagnosis("sensor"), ("obstacle", UNLISTED)
    (step,), problem = found.steps, found.problem
    setting, n_events = setting_of(problem, found.law), problem.campaign.n_events
    comparison = comparison_of(problem, {"sensor_bias": 40.0, "obstacle": 39.6, UNLISTED: 39.0})
    (under_errors,) = comparison.under_each
    points = np.column_stack([np.full(n_events, np.log(0.4)), np.zeros(n_events)])
    both = {
        name: fitted(under_errors.candidates[name], setting, points) for name in ("sensor_bias", "obstacle")
    }
    candidates = {**under_errors.candidates, **both}
    under_errors = replace(under_errors, base=SimpleNamespace(setting=setting), candidates=candidates)
    comparison = replace(comparison, under_each=(under_errors,))
    step = replace(step, candidate=both["sensor_bias"], tied=tied, comparison=comparison)
    decision = Decision("instrument", ("sensor_bias", *tied))
    return with_finding(replace(found, decision=decision, comparison=comparison), steps=(step,))


def test_physics_and_instruments_tied_are_both_told() -> None:
    """Also a force in no list; neither statement nor page says that it is the instruments."""
    found, tied = tied_with_a_dam(), ["obstacle", UNLISTED]
    document, alone = verdict(found), verdict(diagnosis("sensor"))
    assert document["indistinguishable"] == document["mechanisms"][0]["tied_with"] == tied
    bias, dam = "one sensor reads too high or too low", "an obstacle"
    assert alone["statement"].startswith(f"The recordings are off: {bias}")
    assert document["statement"].startswith(
        f"Physics is missing, or the recordings are off; in the lead: {bias}"
    )
    told = rf"cannot tell it from: {dam} \([^)]*%\), a force not in the list \([^)]*%\)\."
    assert re.search(told, document["statement"])
    sensor = document["next_sensor"]
    assert sensor["quantity"] == "front_velocity" and sensor["splits"] == ["sensor_bias", "obstacle"]
    place = sensor["s_from_m"]
    assert f"A speed at s = {place:.0f} m would split {bias} and {dam} best." in document["statement"]
    html = render_diagnosis(document_of(found), figure_data(found), {})
    assert "If it is the recordings that are off, the equation of motion itself keeps its terms" in html
    assert "Physics is missing, or the recordings are off</strong>" in html
    assert "from obstacle, a force not in the list." in html and "not the physics" not in html


def test_the_next_speed_is_where_a_dam_slows_fronts() -> None:
    """A sensor's bias changes no front: what splits both is a speed at or below the dam."""
    found = tied_with_a_dam()
    dam = found.comparison.leading("obstacle").candidates["obstacle"].best.shape
    assert dam.s_from_m is not None and verdict(found)["next_sensor"]["s_from_m"] > dam.s_from_m > 1600.0


@pytest.mark.parametrize("tied", [("entrainment",), ("entrainment", UNLISTED), (UNLISTED,)])
def test_what_no_further_speed_splits(tied: tuple[str, ...]) -> None:
    found = diagnosis("tie")
    step = replace(found.steps[0], tied=tied)
    decision = Decision("missing_physics", (found.decision.names[0], *tied))
    document = verdict(with_finding(replace(found, decision=decision), steps=(step,)))
    assert document["next_sensor"]["splits"] == [] and "cannot tell it from" in document["statement"]
    same = "No further speed would split off snow at rest picked up on a stretch: the term is the same."
    assert (same in document["statement"]) == ("entrainment" in tied)


def test_which_term_is_the_same_is_told_where_it_is_not_the_first() -> None:
    """ "The same term" alone would be that of the name that leads, which it is not."""
    found = diagnosis("tie")
    document = verdict(found)
    tied = document["mechanisms"][0] | {
        "id": "segment_friction",
        "tied_with": ["entrainment", "segment_drag"],
    }
    ids = {"mechanism": "segment_friction", "indistinguishable": tied["tied_with"], "mechanisms": [tied]}
    told = statement(found, document | ids)
    assert "snow at rest picked up on a stretch (the same term as extra drag on a stretch" in told
    assert "(the same term" in document["statement"] and "(the same term as" not in document["statement"]


def test_a_candidate_that_is_not_excluded_is_told() -> None:
    """Of another group, where it is not improbable; those that are tied have a sentence of their own."""
    found = diagnosis("tie")
    document = verdict(found)
    tied = [document["mechanism"], *document["indistinguishable"]]
    rest = {name: 0.0 for name in document["probability"] if name not in tied}
    told = dict.fromkeys(tied, 0.5 / len(tied))
    near = document | {"probability": told | rest | {"release_offset": 0.38, "unlisted": 0.12}}
    assert "Not excluded: release points not where they were noted (38 %)" in statement(found, near)
    far = document | {"probability": told | rest | {"release_offset": 0.04, "unlisted": 0.46}}
    assert "Not excluded" not in statement(found, far)
    two = verdict(diagnosis("two"))
    second = two["mechanisms"][1]["id"]
    both = {two["mechanism"]: 0.5, second: 0.4, "unlisted": 0.05, "nothing": 0.05}
    told = statement(diagnosis("two"), two | {"probability": two["probability"] | both})
    assert f"Not excluded: {mechanisms()[second].title.partition(':')[0]}" not in told


def test_how_sure_a_force_in_no_list_is() -> None:
    found = diagnosis("unexplained")
    document, factors = verdict(found), found.comparison.log_factors
    listed = [name for name in factors if name not in (NOTHING, UNLISTED)]
    closest = max(listed, key=lambda name: factors[name])
    nil = dict.fromkeys(document["probability"], 0.0)

    def said(unlisted: float, listed: float) -> str:
        return statement(found, document | {"probability": nil | {UNLISTED: unlisted, closest: listed}})

    assert "that most probably no listed mechanism accounts for" in said(0.79, 0.19)
    assert "a force not in the list: 79 %" in said(0.79, 0.19) and "comes closest (19 %)" in said(0.79, 0.19)
    assert "that no listed mechanism accounts for" in said(0.96, 0.04)


def test_that_few_avalanches_carry_an_answer_comes_first() -> None:
    found = diagnosis("unexplained")
    assert found.influence is not None
    said = verdict(found)["statement"]
    first, _, rest = said.partition(". ")
    few = " and ".join(found.influence.carried_by)
    assert first.startswith(f"Take this with care: 2 of 22 avalanches carry this answer ({few})")
    assert "25.0 nats with all, 0.5 without, 4.0 needed" in first
    assert rest.endswith(
        f"The odds would not suffice for it without the 21 readings of {found.influence.readings[1].sensor}."
    )
    named = verdict(diagnosis("two"))["statement"]
    assert "Take this with care" not in named and "It does not hang on a few avalanches" in named


def test_that_few_avalanches_carry_a_name_comes_before_what_carries_the_alarm() -> None:
    found = diagnosis("two")
    assert found.influence is not None
    ids = found.influence.events
    rival = Rival("viscous_drag", 3.25, Few(ids[:1], -2.5))
    influence = replace(found.influence, few=Few(ids[:2], 0.5), without_them=9.0, rival=rival)
    document = document_of(replace(found, influence=influence))
    first = document["statement"].partition(". ")[0]
    title = mechanisms()["viscous_drag"].title.partition(":")[0]
    assert first.startswith(
        f"Take this with care: 1 of 22 avalanches carries this answer ({ids[0]}), and without it {title}"
    )
    assert f"2 of 22 avalanches carry the alarm ({ids[0]} and {ids[1]}), and without them the odds" in first
    assert "3.2 nats behind with all, 2.5 ahead without" in first
    assert document["influence"]["carried_by"] == [ids[0]] and document["influence"]["without_them"] == 9.0
    assert document["influence"]["alarm"] == {"carried_by": [ids[0], ids[1]], "without_them": 0.5}
    near = replace(influence, rival=Rival("viscous_drag", 3.25, Few(ids[:1], -0.4)))
    less = document_of(replace(found, influence=near))
    assert f"without it {title} would be about as probable (3.2 nats behind" in less["statement"]
    assert f"without {ids[0]} another answer would be about as probable: " in " ".join(lay_words(less))
    short = short_title(document, "viscous_drag")
    said = " ".join(lay_words(document))
    assert f"Take it with care: without {ids[0]} another answer would be more probable: {short}." in said


def test_that_a_force_in_no_list_is_more_probable_than_the_name_is_told() -> None:
    found = diagnosis("two")
    document = verdict(found)
    probability = document["probability"] | {UNLISTED: 0.39, document["mechanism"]: 0.31}
    said = statement(found, document | {"probability": probability})
    assert "a force not in the list, which is more probable: 39 %" in said
    assert "which is more probable" not in document["statement"]


def test_of_many_sensors_that_an_answer_needs_five_are_named() -> None:
    """Those without which least is left; how many more there are is told."""
    found = diagnosis("unexplained").influence
    assert found is not None
    less = replace(found, few=None, without_them=None, without_a_third=found.needed - 0.5)
    assert not any("does not hang on a few" in one for one in hangs_on(less))
    assert any("does not hang on a few" in one for one in hangs_on(replace(less, needed=less.needed - 1.0)))
    of_gates = [ReadingsLeftOut("sensor", f"gate{k:02d}", 9, found.needed - k) for k in range(1, 41)]
    zeros = ReadingsLeftOut("zeros", None, 3, found.needed - 0.5)
    said = hangs_on(replace(found, readings=(*of_gates, zeros)))[-1]
    assert said.startswith(
        "The odds would not suffice for it without the 3 readings of zero, nor without the 9 readings of"
    )
    assert "the 9 readings of gate40, nor without the 9 readings of gate39" in said
    assert said.endswith("gate37, nor without those of any one of 36 further sensors.")


def test_the_force_profile_added_is_told() -> None:
    """What avalanches left out gain by it, its equation and its numbers; nothing is named."""
    found = diagnosis("unexplained")
    document = verdict(found)
    law = found.finding
    assert document["mechanism"] is None and document["equation"] is None and document["strength"] is None
    assert document["evidence"]["elpd_diff"] == pytest.approx(1.1 * found.problem.campaign.n_events)
    assert "For avalanches left out the log score rises by 24.2" in document["statement"]
    profile = document["profile"]
    assert profile["equation"] == "-f(s)" and profile["unit"] == "m s-2"
    assert profile["s_m"] == law.profile.knots_m.tolist() and max(profile["mean"]) > 0.45
    assert document["p_value_augmented"] == law.check.p_value
    failed = replace(law, check=BootstrapTest(30.0, law.check.simulated))
    assert "still fails the check" in verdict(replace(found, finding=failed))["statement"]
    assert "still fails the check" not in document["statement"]


@pytest.mark.parametrize("kind", ["sensor", "tie"])
def test_what_the_form_of_a_term_is_uncertain_by_is_in_the_strength(kind: str) -> None:
    """Of physics, not of instruments: a factor is a factor."""
    found = diagnosis(kind)
    (step,) = found.steps
    mean, sd = strength_of(found.steps, 0)
    draws = chains_of(step.calibration.tree, step.calibration.problem.added[0].name)
    assert mean == pytest.approx(draws.mean(), rel=1e-3)  # equally strong at all places
    form = 0.0 if kind == "sensor" else FORM * mean
    assert sd == pytest.approx(float(np.hypot(draws.std(ddof=1), form)), rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "direction", "words"),
    [
        ("sensor", Direction(log_readings=np.zeros(4)), ": it reads {} too high."),
        (
            "two",
            Direction(log_strengths=np.zeros(22)),
            ": one standard deviation up, dry friction is {} more.",
        ),
    ],
)
def test_logarithms_of_factors_are_said_in_percent_too(kind: str, direction: Direction, words: str) -> None:
    found = diagnosis(kind)
    step = found.steps[0]
    curves = tuple(replace(one, direction=direction) for one in step.candidate.curves)
    step = replace(step, candidate=replace(step.candidate, curves=curves))
    document = verdict(with_finding(found, steps=(step, *found.steps[1:])))
    change = np.expm1(document["strength"]["mean"])
    assert words.format(f"{100.0 * change:.0f} %") in document["statement"]
    assert "it reads" not in verdict(diagnosis("tie"))["statement"]


@pytest.mark.parametrize(
    ("mean", "sd", "unit", "text"),
    [
        (2.169, 0.757, "m s-2", "2.17 ± 0.76 m/s²"),
        (0.0027, 0.00102, "m-1", "0.0027 ± 0.0010 1/m"),
        (2.6106e-4, 7.93e-5, "m-1", "(2.61 ± 0.79)e-4 1/m"),
        (-3e-5, 4.96e-5, "m-1", "(-3.0 ± 5.0)e-5 1/m"),
        (1234.4, 345.0, "m", "1234 ± 345 m"),
        (0.0999, 0.0996, "1", "0.10 ± 0.10"),
        (0.3, 0.0, "1", "0.3"),
    ],
)
def test_a_strength_has_two_digits_of_its_deviation(mean: float, sd: float, unit: str, text: str) -> None:
    assert plus_minus(mean, sd, unit) == text


@pytest.mark.parametrize("logarithm", [False, True])
def test_how_a_covariate_enters_is_told(logarithm: bool) -> None:
    """To programs with what it is standardised by, to readers in the statement."""
    found = diagnosis("two")
    name = verdict(found)["covariate"]
    sizes = np.geomspace(1.0, 1e4, 22) if logarithm else np.linspace(1.0, 2.0, 22)
    campaign = found.problem.campaign
    events = tuple(
        replace(event, covariates={name: float(size)})
        for event, size in zip(campaign.events, sizes, strict=True)
    )
    problem = replace(found.problem, campaign=replace(campaign, events=events))
    document = verdict(replace(found, problem=problem))
    values = np.log(sizes) if logarithm else sizes
    standard = document["mechanisms"][0]["standard"]
    assert standard["logarithm"] is logarithm and standard["kinds"] == []
    assert standard["centre"] == pytest.approx(values.mean()) and standard["scale"] == pytest.approx(
        values.std()
    )
    assert (f"({name}, by its logarithm)" in document["statement"]) is logarithm
    assert (f"({name})" in document["statement"]) is not logarithm
    assert document["mechanisms"][1]["standard"] is None


@pytest.mark.parametrize(
    ("mechanism", "about", "mean", "said"),
    [
        ("sensor_bias", "sensor", -0.1, " (CD, which reads low)"),
        ("sensor_place", "sensor", 40.8, " (CD, 41 m further down than noted)"),
        ("sensor_place", "sensor", -12.2, " (CD, 12 m further up than noted)"),
        ("covariate_friction", "covariate", 0.3, " (CD)"),
    ],
)
def test_the_first_paragraph_says_what_is_off_of_a_sensor(
    mechanism: str, about: str, mean: float, said: str
) -> None:
    document = {"verdict": "instrument", "mechanism": mechanism, about: "CD", "strength": {"mean": mean}}
    assert said in " ".join(lay_words(document))


def test_the_first_paragraph_says_how_well_the_ends_of_a_stretch_are_known() -> None:
    location = {"s_from_m": 1179.0, "s_to_m": 1779.0}
    document = {"verdict": "missing_physics", "mechanism": "segment_friction", "location": location}
    assert "between 1179 and 1779 m along the track." in " ".join(lay_words(document))
    location |= {"s_from_interval_m": [939.0, 1354.0], "s_to_interval_m": [1704.0, 1829.0]}
    known = "(begins at 939 to 1354, ends at 1704 to 1829)"
    assert f"between 1179 and 1779 m along the track {known}." in " ".join(lay_words(document))


def test_what_cannot_be_told_from_a_second_one_is_said() -> None:
    found = diagnosis("two")
    first, second = found.steps
    told = document_of(with_finding(found, steps=(first, replace(second, tied=("sensor_bias",)))))
    assert "These recordings cannot tell it from: one sensor" in told["statement"]
    assert " or one sensor reads too high or too low." in " ".join(lay_words(told))
    assert "cannot tell it from" not in verdict(found)["statement"]


def test_physics_and_a_fault_of_a_sensor_are_told_as_both() -> None:
    document = document_of(diagnosis("two"))
    named = document["mechanisms"]
    named[1] |= {"id": "sensor_bias", "group": "instrument", "sensor": "CD"}
    told = " ".join(lay_words(document))
    assert "a force is missing, and the recordings are off: friction" in told
    assert "; beside it, " in told and "one sensor reads too high or too low (CD)." in told


def with_force_beside(comparison: Comparison, name: str, more: float) -> Comparison:
    """A comparison where a force beside a mechanism adds so many nats to what it has."""
    under = comparison.leading(name)
    one = under.candidates[name]
    own = one.by_itself - one.alone
    residue = own + more + math.log((1.0 - (1.0 - BESIDE) * math.exp(-more)) / BESIDE)
    other = replace(under, candidates={**under.candidates, name: replace(one, residue=residue)})
    return replace(
        comparison, under_each=tuple(other if each is under else each for each in comparison.under_each)
    )


def test_of_what_comes_closest_it_is_said_what_it_has_by_itself() -> None:
    found = diagnosis("unexplained")
    listed = [name for name in found.comparison.log_factors if name not in (NOTHING, UNLISTED)]
    name = max(listed, key=lambda one: found.comparison.probability[one])
    again = with_force_beside(found.comparison, name, 20.0)
    by_itself = found.comparison.log_factors[name]
    said = verdict(replace(found, comparison=again))["statement"]
    assert f"its log Bayes factor is {by_itself:.1f} nats by itself and" in said
    assert "with such a force allowed for" not in verdict(found)["statement"]


def test_a_second_name_that_is_tied_is_not_called_sure() -> None:
    document = document_of(diagnosis("two"))
    document["mechanisms"][1]["tied_with"] = ["obstacle"]
    document["report"]["comparisons"][1]["probability"][document["mechanisms"][1]["id"]] = 0.5
    told = " ".join(lay_words(document))
    assert "; beside it " in told and "; beside it, " not in told


def test_errors_before_and_after_have_as_many_decimals() -> None:
    assert error_texts([1.02, 0.997], "m s-1") == ["1.02", "1.00"]
    assert error_texts([10.3, 9.96], "m") == ["10.3", "10.0"]
    assert error_texts([0.0, 6.12], "m s-1") == ["0.0", "6.1"]
    assert error_texts([71.0, 66.3], "m") == ["71", "66"]


def test_a_name_that_counts_together_with_a_force_beside_it_says_what_it_has_by_itself() -> None:
    found = diagnosis("tie")
    named, tied = found.decision.names[0], next(one for one in found.decision.tied if one != UNLISTED)
    factor = found.comparison.log_factors[named]
    assert "force in no list beside it" not in verdict(found)["statement"]
    for name, more, told in ((named, 20.0, True), (named, 0.5, False), (tied, 20.0, True)):
        again = with_force_beside(found.comparison, name, more)
        first, *others = found.steps
        steps = (replace(first, comparison=again), *others)
        document = document_of(replace(with_finding(found, steps=steps), comparison=again))
        said = document["statement"]
        if name == named:
            with_it = again.log_factors[named]
            sentence = f"nats by itself and {with_it:.1f} with such a force"
            assert (sentence in said) == told
            row = next(one for one in document["candidates"] if one["id"] == named)
            assert row["log_bayes_factor_by_itself"] == pytest.approx(factor)
            assert with_it > factor
        else:
            assert ", with a force in no list beside it" in said and "by itself and" not in said


def test_that_the_law_still_does_not_fit_is_told_to_everyone() -> None:
    document = document_of(diagnosis("two"))
    told = "Even so the model does not fit"
    assert told not in " ".join(lay_words(document | {"p_value_augmented": 0.2}))
    assert told in " ".join(lay_words(document | {"p_value_augmented": 0.01}))


def test_of_a_second_mechanism_strength_and_how_avalanches_differ_are_told_too() -> None:
    found = diagnosis("two")
    document = verdict(found)
    second = document["mechanisms"][1]
    said = document["statement"].partition("Given that")[2]
    assert f"Its {second['strength']['parameter'].replace('_', ' ')} is" in said
    differing = {**second["strength"], "ways": {"common": 0.1, "spread": 0.8, "some": 0.1}}
    others = [document["mechanisms"][0], {**second, "strength": differing, "covariate": "depth"}]
    said = statement(found, document | {"mechanisms": others}).partition("Given that")[2]
    assert "Avalanches probably differ in it (90 %)" in said
    assert "Associated with, not necessarily caused by." in said


def test_what_a_next_speed_would_split_is_read_where_something_is_recorded() -> None:
    """Above the first recording fitted fronts differ by their releases, which a reading there would move."""
    found = tied_with_a_dam()
    comparison = found.comparison
    recorded = comparison.under_each[0].base.setting.recorded_m
    under = comparison.leading(found.decision.names[0])
    one = under.candidates[found.decision.names[0]]
    off = np.array([-0.1, 40.0])
    moved = replace(one.best, fits=tuple(fit._replace(points=fit.points + off) for fit in one.best.fits))
    candidate = replace(one, curves=(moved,), log_weights=np.zeros(1), log_between=0.0, looked=())
    step = replace(found.steps[0], candidate=candidate)
    campaign = found.problem.campaign
    events = tuple(replace(event, release_sd_m=20.0) for event in campaign.events)
    problem = replace(found.problem, campaign=replace(campaign, events=events))
    sensor = next_sensor(with_finding(replace(found, problem=problem), steps=(step, *found.steps[1:])))
    assert sensor is not None
    assert sensor["splits"] and sensor["s_from_m"] >= recorded[0]


def test_what_was_found_and_could_not_be_added_is_said() -> None:
    nothing_after = {"after": None, "influence": None, "conditional": None}
    cannot, gone = Decision("cannot_tell", ()), NotAugmented("the gate failed")
    found = replace(diagnosis("two"), decision=cannot, finding=gone, **nothing_after)
    said = verdict(found)["statement"]
    assert said.startswith("These recordings cannot tell: there is an alarm (p ")
    assert said.endswith("(more than 99 %), but it could not be added; the gate failed.")
    assert "friction that goes with a property" in said
