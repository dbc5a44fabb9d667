"""What an answer hangs on: against the same evidence computed from campaigns that lack the recordings."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnosis_cases import base_of, made_way
from rolling_cases import rolling

from skred.campaign import Campaign
from skred.campaign.parts import of_events
from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.augment.step import Step
from skred.diagnosis.compare.between import with_ways
from skred.diagnosis.compare.candidate import Beside, Candidate
from skred.diagnosis.compare.comparison import (
    Comparison,
    ComparisonUnderErrors,
    free_force,
    with_errors,
)
from skred.diagnosis.compare.residue import with_residues
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.compare.ways import Looked
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.evidence.coefficient import Curve, curve_at, curve_near
from skred.diagnosis.evidence.prior_odds import UNLISTED, prior_odds
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING
from skred.diagnosis.influence.influence import FloatArray, influence
from skred.diagnosis.influence.margin import MOST, Change, Margin
from skred.diagnosis.influence.part import Part, kinds_of
from skred.diagnosis.predict.held_out import gained_by, held_out
from skred.inference.between_events import PRIOR, BetweenEvents
from skred.inference.calibrate import calibrate
from skred.inference.sampling import SamplerSettings
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape

DRAG = mechanisms()["turbulent_drag"]
ENOUGH = math.log(99.0)
"""Log odds that raise an alarm whatever clean campaigns are like."""


def drag_in(campaign: Campaign) -> tuple[Comparison, Curve]:
    """A comparison that has drag along the track alone."""
    base = base_of(campaign, "coulomb")
    found = curve_near(base, curve(base, placed(DRAG, base.setting, Shape())), Shape())
    candidates = {DRAG.id: Candidate(DRAG, (found,), np.zeros(1))}
    under_errors = ComparisonUnderErrors("robust", base, candidates, [])
    return Comparison((under_errors,), prior_odds([DRAG]), {"robust": 0.0}), found


def without_one(campaign: Campaign, event: int) -> float:
    """The log Bayes factor by a campaign that never had an avalanche."""
    others = [k for k in range(campaign.n_events) if k != event]
    return drag_in(of_events(campaign, others))[1].log_bayes_factor


def each_takes(campaign: Campaign, comparison: Comparison) -> FloatArray:
    """What each avalanche takes of the log Bayes factor, by the campaigns that never had it."""
    factor = comparison.under_each[0].log_factors[DRAG.id]
    return np.array([factor - without_one(campaign, event) for event in range(campaign.n_events)])


@pytest.mark.slow
def test_without_an_avalanche_as_in_a_campaign_that_never_had_it() -> None:
    """The gain in its density, given the others, is what it takes: by sampling, and by leaving it out."""
    # As much friction as drag: what is left of it with more drag than there is stays positive.
    campaign = rolling(2.4e-4, n_events=10, friction=0.015)
    comparison, found = drag_in(campaign)
    base, settings = comparison.under_each[0].base, SamplerSettings("metropolis", draws=600, tune=500, seed=0)
    with_drag = calibrate(augmented_problem(base, [found]), base.law, settings)
    without = calibrate(base.problem, base.law, settings)
    assert with_drag.gate.numerics and without.gate.numerics
    gained = held_out(with_drag, 0).pointwise - held_out(without, 0).pointwise
    said = influence(comparison, DRAG.id, gained, ENOUGH)
    assert said.log_bayes_factor == pytest.approx(found.log_bayes_factor)
    for event in (0, 7):
        assert said.without_each[event] == pytest.approx(without_one(campaign, event), abs=0.5)


@pytest.mark.slow
def test_a_first_finding_is_judged_under_its_own_errors() -> None:
    """The base law that it is held against has its errors too, whatever the base law was calibrated under."""
    campaign = rolling(2.4e-4, n_events=8, friction=0.015)
    values = np.array(campaign.values)
    values[4, 2] += 3.0  # far off: what it costs is another thing under each error model
    robust = base_of(replace(campaign, values=values), "coulomb")
    student, settings = with_errors(robust, "student"), SamplerSettings(draws=300, tune=300, seed=0)
    found = curve_near(student, curve(student, placed(DRAG, student.setting, Shape())), Shape())
    candidate = Candidate(DRAG, (found,), np.zeros(1))
    under_errors = ComparisonUnderErrors("student", student, {DRAG.id: candidate}, [])
    comparison = Comparison((under_errors,), prior_odds([DRAG]), {"student": 0.0})
    with_drag = calibrate(augmented_problem(student, [found]), student.law, settings)
    not_asked: Any = None
    step = Step(candidate, (), comparison, with_drag, not_asked)
    gained = gained_by(step, calibrate(robust.problem, robust.law, settings), 0)
    assert gained is not None
    after = held_out(with_drag, 0).pointwise
    own, other = (
        after - held_out(calibrate(one.problem, one.law, settings), 0).pointwise for one in (student, robust)
    )
    np.testing.assert_allclose(gained, own, atol=0.3)
    assert np.abs(other - own).max() > 2.0
    alone = calibrate(student.problem, student.law, settings)
    failed = replace(alone, gate=alone.gate.with_numerical_problems(["too rough"]))
    assert gained_by(step, failed, 0) is None


def test_a_strong_effect_in_all_avalanches_hangs_on_no_few() -> None:
    comparison = drag_in(rolling(2.4e-4, n_events=12))[0]
    said = influence(comparison, DRAG.id, np.full(12, comparison.log_factors[DRAG.id] / 12), ENOUGH)
    assert said.carried_by == () and said.without_them is None and said.rival is None
    assert said.needed < said.without_a_third < said.log_bayes_factor


def test_avalanches_that_carry_an_answer_are_found() -> None:
    """Two runs are read finely enough to tell a drag, the others far too coarsely."""
    campaign = rolling(2.4e-4, n_events=9)
    coarse = np.full(campaign.values.shape, 3.0)
    coarse[[2, 5]] = 0.1
    campaign = replace(campaign, stated_sd=coarse)
    comparison = drag_in(campaign)[0]
    said = influence(comparison, DRAG.id, each_takes(campaign, comparison), ENOUGH)
    assert set(said.carried_by) <= {"run02", "run05"} and said.carried_by
    assert len(said.carried_by) <= MOST * campaign.n_events
    assert said.without_them is not None and said.without_them < said.needed < said.log_bayes_factor
    assert said.without_a_third < said.needed
    assert {said.events[k] for k in np.argsort(said.without_each)[:2]} == {"run02", "run05"}


def two_drags(campaign: Campaign) -> tuple[Comparison, float]:
    """A comparison of drags with U^2 and with U, and how far the first is ahead."""
    base = base_of(campaign, "coulomb")
    candidates, found = {}, []
    for mechanism in (DRAG, mechanisms()["viscous_drag"]):
        one = curve(base, placed(mechanism, base.setting, Shape()))
        one = curve_near(base, one, Shape())
        candidates[mechanism.id] = Candidate(mechanism, (one,), np.zeros(1))
        found.append(one.log_bayes_factor)
    under_errors = ComparisonUnderErrors("robust", base, candidates, [])
    odds = prior_odds([one.mechanism for one in candidates.values()])
    return Comparison((under_errors,), odds, {"robust": 0.0}), found[0] - found[1]


def test_a_rival_is_what_is_most_probable_and_not_tied() -> None:
    campaign = rolling(2.4e-4, n_events=9)
    campaign = replace(campaign, stated_sd=np.full(campaign.values.shape, 0.15))
    comparison, ahead = two_drags(campaign)
    said = influence(comparison, DRAG.id, np.full(9, comparison.log_factors[DRAG.id] / 9), ENOUGH)
    assert said.rival is not None and said.rival.id == "viscous_drag"
    assert said.rival.ahead == pytest.approx(ahead)
    # All runs were drawn with the same drag: none of them tells alone which one it is.
    assert said.rival.few is None and said.carried_by == ()
    assert influence(comparison, DRAG.id, said.without_each, ENOUGH, ["viscous_drag"]).rival is None


def test_a_force_in_no_list_is_a_rival_and_has_one() -> None:
    comparison = two_drags(rolling(2.4e-4, n_events=9))[0]
    under = comparison.under_each[0]
    profiles = [free_force(under.base, kind, {}) for kind in KINDS]
    compared = replace(comparison, under_each=(replace(under, profiles=profiles),))
    gained = np.full(9, compared.log_factors[DRAG.id] / 9)
    drag = influence(compared, DRAG.id, gained, ENOUGH, ["viscous_drag"])
    assert drag.rival is not None and drag.rival.id == UNLISTED
    # Every run was drawn with the same drag, which needs no shape: no few of them tell.
    assert drag.rival.ahead > 3.0 and drag.rival.few is None
    force = influence(compared, UNLISTED, gained, ENOUGH)
    assert force.rival is not None and force.rival.id == DRAG.id
    assert force.rival.ahead == pytest.approx(-drag.rival.ahead)


def test_an_answer_with_a_force_beside_it_is_held_against_its_rival_as_it_was_compared() -> None:
    """Waves of the ground look like a drag with U in some runs: with a force beside either they do not."""
    comparison, ahead = two_drags(rolling(2.4e-4, waves=0.05, n_events=9))
    under = comparison.under_each[0]
    profiles = [free_force(under.base, kind, {}) for kind in KINDS]
    with ThreadPoolExecutor(2) as pool:
        candidates = with_residues(under.base, under.candidates, profiles, pool)
    compared = replace(comparison, under_each=(replace(under, candidates=candidates),))
    said = influence(compared, DRAG.id, np.full(9, candidates[DRAG.id].alone / 9), ENOUGH)
    assert said.rival is not None and 0.0 < said.rival.ahead < 0.3 * ahead
    # Drags by themselves change by more than that where one run is left out, whole comparisons do not.
    assert said.rival.few is None and said.carried_by == ()


def test_a_rival_that_cannot_be_refitted_leaves_what_the_alarm_hangs_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A step of a force beside it can lead to what no front can do."""
    comparison = two_drags(rolling(2.4e-4, n_events=9))[0]
    under = comparison.under_each[0]
    force = Beside(under.candidates["viscous_drag"].best, (free_force(under.base, KINDS[0], {}),))
    both = dict(under.candidates)
    both["viscous_drag"] = replace(both["viscous_drag"], residue=1.0, beside=force)
    compared = replace(comparison, under_each=(replace(under, candidates=both),))

    def broken(*given: Any) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr("skred.diagnosis.influence.influence.fit_beside", broken)
    said = influence(compared, DRAG.id, np.full(9, both[DRAG.id].alone / 9), ENOUGH)
    assert said.rival is None and said.few is None and len(said.without_each) == 9


@pytest.mark.parametrize(
    ("whole", "fewest", "against"),
    [
        (2.5, (4,), 0.1), (4.0, (1, 4), 0.1), (5.6, (1, 2, 4), 0.1), (8.0, None, 0.1), (5.2, (1, 2, 4), 2.0),
        (2.5, (4,), 2.0), (-0.1, (4,), 0.1),
    ],
)  # fmt: skip
def test_the_fewest_avalanches_without_which_a_rival_leads(
    whole: float, fewest: tuple[int, ...] | None, against: float
) -> None:
    """What each takes of both adds up here: of the difference 3, 2 and 1 nats, and others against it."""
    own = np.array([1.0, 4.0, 2.0, 1.0, 3.0, 0.0, 0.0, 1.0, 0.0])
    other = own - np.array([-against, 2.0, 1.0, -against, 3.0, -against, 0.0, 0.0, -against])

    def takes(each: FloatArray) -> Callable[[Part], float]:
        return lambda part: float(100.0 + each[part.kept].sum())

    with ThreadPoolExecutor(1) as pool:
        change = Change(takes(own), pool)
        margin = Margin(whole, own - other, change, Change(takes(other), pool))
        found = margin.fewest()
    if fewest is None:
        assert found is None
        return
    assert found is not None
    assert tuple(np.flatnonzero(found[0])) == fewest
    assert found[1] == pytest.approx(whole - (own - other)[list(fewest)].sum()) and found[1] < 0.0


def test_one_avalanche_among_many_that_speak_against_the_answer_is_found() -> None:
    """Of the third that take most all but one speak against it: without all of them it would stand."""
    gains = np.array([3.0] + [-0.9] * 8)
    with ThreadPoolExecutor(1) as pool:
        found = Margin(2.5, gains, Change(lambda part: float(gains[part.kept].sum()), pool)).fewest()
        none = Margin(2.5, -np.abs(gains), Change(lambda part: float(part.kept.sum()), pool)).fewest()
    assert found is not None and tuple(np.flatnonzero(found[0])) == (0,)
    assert found[1] == pytest.approx(-0.5)
    assert none is None


def test_readings_are_left_out_by_sensor_and_kind() -> None:
    """Readings of zero are a kind of their own; no runout is recorded, so nothing is beside a stop."""
    campaign = rolling(2.4e-4, n_events=8)
    values = np.array(campaign.values)
    values[3, -1] = 0.0
    said = influence(drag_in(replace(campaign, values=values))[0], DRAG.id, np.zeros(8), ENOUGH)
    kinds = [(one.kind, one.sensor, one.n) for one in said.readings]
    assert kinds == [("zeros", None, 1), *(("sensor", f"s{k}", 8) for k in range(6))]


def test_refits_at_the_best_strength_of_a_shape_have_nearly_what_all_strengths_give() -> None:
    """Without one sensor after the other, over stretches of which some are nearly as good as the best one."""
    base = base_of(rolling(2.4e-4, n_events=8), "coulomb")
    drag = mechanisms()["segment_drag"]
    assert drag.added is not None
    looked = [curve(base, placed(drag, base.setting, one)) for one in drag.added.shapes(base.setting)]
    found = sorted(looked, key=lambda one: -one.log_bayes_factor)[:6]
    curves = tuple(curve_near(base, one, one.shape) for one in found)
    candidates = {drag.id: Candidate(drag, curves, np.full(6, -np.log(6.0)))}
    comparison = Comparison(
        (ComparisonUnderErrors("robust", base, candidates, []),), prior_odds([drag]), {"robust": 0.0}
    )
    said = influence(comparison, drag.id, np.zeros(8), ENOUGH)
    for left, (_, _, chosen) in zip(said.readings, kinds_of(base), strict=True):
        rest = Part(np.ones(8, dtype=bool), chosen).base(base)
        again = [curve_at(rest, one, one.strengths, known=one.known).log_bayes_factor for one in curves]
        whole = np.logaddexp.reduce(again) - np.log(6.0)
        assert left.log_bayes_factor == pytest.approx(whole, abs=DECIDES_NOTHING)
    assert min(one.log_bayes_factor for one in said.readings) < said.log_bayes_factor - 5.0


def test_an_answer_may_lose_what_the_alarm_has_to_spare() -> None:
    """Others that are tied with it raise the alarm, too: by itself it may have less than an alarm takes."""
    campaign = rolling(2.4e-4, n_events=8)
    comparison = drag_in(campaign)[0]
    said = influence(comparison, DRAG.id, np.zeros(8), comparison.log_odds - 1.5)
    assert said.needed == pytest.approx(said.log_bayes_factor - 1.5)
    # A force beside it raises no alarm, for clean campaigns are not searched for one: nothing more to spare.
    under = comparison.under_each[0]
    candidates = {DRAG.id: replace(under.candidates[DRAG.id], residue=20.0)}
    beside = replace(comparison, under_each=(replace(under, candidates=candidates),))
    assert beside.log_factors[DRAG.id] > comparison.log_factors[DRAG.id] + 5.0
    assert beside.log_odds == pytest.approx(comparison.log_odds)
    again = influence(beside, DRAG.id, np.zeros(8), comparison.log_odds - 1.5)
    assert again.needed == pytest.approx(said.needed)


@pytest.mark.slow
def test_the_alarm_goes_by_strengths_in_common() -> None:
    """What an answer gains where avalanches differ is to spare, for no alarm has it; and some may be lost."""
    comparison = drag_in(rolling(2.4e-4, n_events=8))[0]
    under = comparison.under_each[0]
    for gain in (5.0, -0.6):
        candidate = replace(
            under.candidates[DRAG.id], looked=(gaining(under.candidates[DRAG.id].best, gain),)
        )
        differing = replace(comparison, under_each=(replace(under, candidates={DRAG.id: candidate}),))
        assert differing.log_odds == pytest.approx(comparison.log_odds)
        said = influence(differing, DRAG.id, np.zeros(8), differing.log_odds)
        assert said.log_bayes_factor == pytest.approx(candidate.alone + gain)
        assert said.needed == pytest.approx(said.log_bayes_factor)


def gaining(found: Curve, gain: float) -> Looked:
    """A shape where differing strengths gain so many nats over one in common, their prior included."""
    over = math.log((math.exp(gain) - PRIOR[BetweenEvents.COMMON]) / PRIOR[BetweenEvents.SPREAD])
    in_common = found.log_factor_of(found.sign)
    return Looked(found, 0.0, in_common, {BetweenEvents.SPREAD: made_way(in_common + over)})


@pytest.mark.slow
def test_where_avalanches_may_differ_that_is_in_what_is_left() -> None:
    """The ways of a part are those of that part: with fewer avalanches and readings, at the best shape."""
    comparison = drag_in(rolling(2.4e-4, n_events=12))[0]
    under = comparison.under_each[0]
    with ThreadPoolExecutor(1) as pool:
        candidates = with_ways(under.base, under.candidates, pool)
    differing = replace(comparison, under_each=(replace(under, candidates=candidates),))
    gained = np.full(12, comparison.log_factors[DRAG.id] / 12)
    plain, said = (influence(one, DRAG.id, gained, ENOUGH) for one in (comparison, differing))
    assert candidates[DRAG.id].looked
    # All runs have the same drag: ways gain little, in all of them and in a part.
    assert abs(said.without_a_third - plain.without_a_third) < 2.0
    assert len(said.readings) == len(plain.readings)
